"""First training phase: encoder, fields and feature renderer (paper, Sec. 3.3)."""

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch
from jaxtyping import Float, Int
from torch import Tensor

from pe_runtime.checkpoint import fit, load_checkpoint, save_checkpoint
from pe_runtime.config import ModelConfig, SynthesisConfig, as_dict
from pe_runtime.contract.errors import ConfigError
from pe_runtime.dataset import Clips, FrameBatch
from pe_runtime.networks import Codes, SynthesisNetworks
from pe_runtime.rendering.scene import RenderSettings
from pe_runtime.training.augmentation import recolour
from pe_runtime.training.loop import (
    Log,
    Schedule,
    learning_rate_share,
    optimiser_tensors,
    restore_optimiser,
    run,
)
from pe_runtime.training.perceptual import RandomFeatures, gradient_distance

BORDER = 4
"""Pixels at the rim of a patch that the loss leaves out: F sees no neighbours there."""


class SynthesisPhase:
    """Reconstruct patches of frames from their own poses and their neighbours' styles.

    Args:
        networks: What is trained.
        clips: Training sequences.
        held_out: Sequences for measurements, if any.
        config: Losses, patches, rates.

    Raises:
        ConfigError: Patches or frame counts that the clips do not have.
    """

    def __init__(
        self,
        networks: SynthesisNetworks,
        clips: Clips,
        held_out: Clips | None,
        config: SynthesisConfig,
    ) -> None:
        _check_fit(networks.config, clips, config)
        self.networks, self.clips, self.held_out, self.config = networks, clips, held_out, config
        self.device = next(networks.parameters()).device
        decoder = list(networks.feature_renderer.parameters())
        taken = {id(p) for p in decoder}
        rest = [p for p in networks.parameters() if id(p) not in taken]
        self.rates = (config.learning_rate, config.renderer_learning_rate)
        self.optimiser = torch.optim.Adam(
            [{"params": rest}, {"params": decoder}], betas=(0.9, 0.99)
        )
        self.perceptual = RandomFeatures().to(self.device)

    def step(self, progress: float) -> Log:
        """One optimisation step."""
        config = self.config
        self.networks.train()
        share = learning_rate_share(progress, config.warmup / config.steps)
        for group, rate in zip(self.optimiser.param_groups, self.rates, strict=True):
            group["lr"] = rate * share
        batch = self._sample().to(self.device)
        windows = self._windows(batch)
        with torch.autocast(self.device.type, torch.bfloat16, enabled=config.bfloat16):
            images = self._reconstruct(batch, windows)
        loss, logs = self._loss(images, _cut(batch.images, windows, images.shape[-2:]))
        self.optimiser.zero_grad(set_to_none=True)
        loss.backward()
        norm = torch.nn.utils.clip_grad_norm_(self.networks.parameters(), config.clip)
        self.optimiser.step()
        return logs | {
            "loss": float(loss.detach()),
            "gradient": float(norm),
            "rate": self.rates[0] * share,
        }

    def _sample(self) -> FrameBatch:
        """Some frames of some sequences; frames of a sequence stay neighbours in the batch."""
        clips = torch.randint(len(self.clips), (self.config.sequences,))
        length, frames = self.clips.images.shape[1], self.config.frames
        times = torch.stack([torch.randperm(length)[:frames] for _ in range(len(clips))])
        batch = self.clips.batch(clips.repeat_interleave(frames), times.flatten())
        return replace(batch, images=recolour(batch.images, frames, self.config.recoloured))

    def _windows(self, batch: FrameBatch) -> Int[Tensor, "frames 2"]:
        """Top-left corners of the patches, most of them around a player."""
        config, cameras = self.config, batch.cameras
        grid = self.networks.config.feature_renderer.strides[-1]
        limit = torch.tensor(
            [cameras.height - config.patch_height, cameras.width - config.patch_width]
        )
        half = torch.tensor([config.patch_height, config.patch_width]) / 2
        corners = []
        for boxes in batch.boxes.cpu():
            corner = torch.rand(2) * limit
            found = boxes[torch.isfinite(boxes).all(dim=-1)]
            if len(found) and float(torch.rand(())) < config.player_patches:
                box = found[int(torch.randint(len(found), ()))]
                middle = torch.stack([box[1] + box[3], box[0] + box[2]]) / 2
                corner = middle - half + (torch.rand(2) - 0.5) * half
            corner = torch.minimum(corner.clamp(min=0), limit.float())
            corners.append((corner / grid).floor().long() * grid)
        return torch.stack(corners)

    def _reconstruct(
        self, batch: FrameBatch, windows: Int[Tensor, "frames 2"]
    ) -> Float[Tensor, "frames 3 height width"]:
        config = self.config
        codes = self.networks.encode(batch.images, batch.cameras, batch.boxes)
        if config.permute_style:
            codes = {name: _permuted(each, config.frames) for name, each in codes.items()}
        settings = RenderSettings(
            near=self.networks.config.near,
            jitter=True,
            density_noise=config.density_noise,
            bucket=1024,
        )
        size = (config.patch_height, config.patch_width)
        return self.networks.synthesise(batch.cameras, codes, windows, size, settings)

    def _loss(self, images: Tensor, targets: Tensor) -> tuple[Tensor, Log]:
        inner = (..., slice(BORDER, -BORDER), slice(BORDER, -BORDER))
        images, targets = images[inner], targets[inner]
        squared = (images - targets).square().mean()
        gradient = gradient_distance(images, targets)
        perceptual = self.perceptual(images, targets)
        config = self.config
        loss = squared + config.gradient_weight * gradient
        loss = loss + config.perceptual_weight * perceptual
        psnr = -10 * torch.log10(squared.detach().clamp(min=1e-10))
        return loss, {"psnr_patch": float(psnr), "perceptual": float(perceptual.detach())}

    @torch.no_grad()
    def evaluate(self) -> Log:
        """PSNR of whole held-out frames and of player boxes, with own and with another pose."""
        if self.held_out is None:
            return {}
        self.networks.eval()
        errors: dict[str, list[Tensor]] = {"psnr": [], "psnr_box": [], "psnr_box_other_pose": []}
        times = torch.linspace(0, self.held_out.images.shape[1] - 1, 3).long()
        with torch.autocast(self.device.type, torch.bfloat16, enabled=self.config.bfloat16):
            for clip in range(min(len(self.held_out), 8)):
                batch = self.held_out.batch(torch.full_like(times, clip), times).to(self.device)
                codes = self.networks.encode(batch.images, batch.cameras, batch.boxes)
                other = {n: replace(c, pose=c.pose.roll(1, 0)) for n, c in codes.items()}
                squares = (self._draw(batch, codes) - batch.images).square().mean(dim=1)
                swapped = (self._draw(batch, other) - batch.images).square().mean(dim=1)
                errors["psnr"].append(squares.mean())
                for index, box in ((i, b) for i, boxes in enumerate(batch.boxes) for b in boxes):
                    if not torch.isfinite(box).all():
                        continue
                    left, top, right, bottom = box.round().int().clamp(min=0).tolist()
                    region = (index, slice(top, bottom), slice(left, right))
                    if squares[region].numel() == 0:
                        continue
                    errors["psnr_box"].append(squares[region].mean())
                    errors["psnr_box_other_pose"].append(swapped[region].mean())
        return {k: float(-10 * torch.stack(v).mean().log10()) for k, v in errors.items() if v}

    def _draw(self, batch: FrameBatch, codes: Mapping[str, Codes]) -> Tensor:
        windows = torch.zeros(len(batch.cameras), 2, dtype=torch.long)
        size = (batch.cameras.height, batch.cameras.width)
        settings = RenderSettings(near=self.networks.config.near)
        return self.networks.synthesise(batch.cameras, codes, windows, size, settings)

    def tensors(self) -> dict[str, Tensor]:
        """Weights and optimiser."""
        weights = {f"networks.{n}": t for n, t in self.networks.state_dict().items()}
        return weights | optimiser_tensors(self.optimiser, "optimiser")

    def restore(self, tensors: Mapping[str, Tensor]) -> None:
        """Take back what `tensors` gave."""
        own = _under(tensors, "networks.")
        fit(self.networks.state_dict(), own, "the checkpoint of this run")
        self.networks.load_state_dict(own)
        restore_optimiser(self.optimiser, tensors, "optimiser")


def train_synthesis(
    config: tuple[ModelConfig, SynthesisConfig],
    data: tuple[Clips, Clips | None],
    output: str | Path,
    minutes: float | None = None,
    resume: bool = False,
    start_from: str | Path | None = None,
    on_log: Callable[[int, Log], None] | None = None,
) -> SynthesisNetworks:
    """Train the synthesis module and write OUTPUT/synthesis.safetensors.

    Args:
        config: The model's and the training's configuration.
        data: Training clips, and held-out clips or None.
        output: Run folder.
        minutes: Wall-clock limit; the learning-rate schedule follows it.
        resume: Go on from the run folder's checkpoint.
        start_from: Model file whose synthesis weights are the starting point.
        on_log: Called with the step and its figures.
    """
    model, training = config
    output = Path(output)
    torch.manual_seed(training.seed)
    device = "cuda" if torch.cuda.is_available() else "cpu"
    networks = SynthesisNetworks(model).to(device)
    if start_from is not None:
        load_synthesis(networks, load_checkpoint(start_from)[1])
    phase = SynthesisPhase(networks, *data, training)
    output.mkdir(parents=True, exist_ok=True)
    described = {"model": as_dict(model), "synthesis": as_dict(training)}
    (output / "config.json").write_text(json.dumps(described, indent=1))
    schedule = Schedule(
        steps=training.steps,
        minutes=minutes,
        evaluate_every=training.evaluate_every,
        checkpoint_every=training.checkpoint_every,
        seed=training.seed,
    )
    steps = run(phase, output, schedule, resume, on_log)
    networks.eval()
    header: dict[str, Any] = {"kind": "synthesis", "config": as_dict(model), "steps": steps}
    save_checkpoint(output / "synthesis.safetensors", prefixed(networks), header)
    return networks


def prefixed(networks: SynthesisNetworks) -> dict[str, Tensor]:
    """The synthesis weights under the names that model files use."""
    return {f"synthesis.{name}": tensor for name, tensor in networks.state_dict().items()}


def load_synthesis(networks: SynthesisNetworks, tensors: Mapping[str, Tensor]) -> None:
    """Put a model file's synthesis weights into networks.

    Raises:
        CheckpointError: They do not fit.
    """
    own = _under(tensors, "synthesis.")
    fit(networks.state_dict(), own, "the synthesis module")
    networks.load_state_dict(own)


def _under(tensors: Mapping[str, Tensor], prefix: str) -> dict[str, Tensor]:
    return {n[len(prefix) :]: t for n, t in tensors.items() if n.startswith(prefix)}


def _check_fit(model: ModelConfig, clips: Clips, config: SynthesisConfig) -> None:
    """Refuse patches and sequences that the data set does not have."""
    length, height, width = clips.images.shape[1:4]
    if config.frames > length:
        raise ConfigError(
            f"synthesis.frames is {config.frames}, but the sequences have {length} frames"
        )
    coarsest = model.feature_renderer.strides[-1]
    for name, patch, frame in (
        ("patch_height", config.patch_height, height),
        ("patch_width", config.patch_width, width),
    ):
        if patch % coarsest or patch > frame:
            raise ConfigError(
                f"synthesis.{name} must be a multiple of {coarsest} (the coarsest stride) and at "
                f"most {frame} (the frames), found {patch}"
            )


def _permuted(codes: Codes, frames: int) -> Codes:
    """Styles of each sequence rolled along time, so that w cannot carry the pose.

    A frame whose neighbour does not show the object keeps its own style.
    """
    style = codes.style.unflatten(0, (-1, frames)).roll(1, dims=1).flatten(0, 1)
    seen = codes.visible.unflatten(0, (-1, frames)).roll(1, dims=1).flatten(0, 1)
    style = torch.where(seen[:, None], style, codes.style)
    return replace(codes, style=style)


def _cut(images: Tensor, windows: Tensor, size: torch.Size) -> Tensor:
    pieces = [
        image[:, top : top + size[0], left : left + size[1]]
        for image, (top, left) in zip(images, windows.tolist(), strict=True)
    ]
    return torch.stack(pieces)
