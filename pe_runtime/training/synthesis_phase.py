"""First training phase: encoder, fields and feature renderer (paper, Sec. 3.3)."""

import math
from collections.abc import Mapping
from dataclasses import replace

import torch
from jaxtyping import Float, Int
from torch import Tensor

from pe_runtime.checkpoint import fit
from pe_runtime.config import ModelConfig, SynthesisConfig
from pe_runtime.contract.errors import ConfigError
from pe_runtime.dataset import Clips, FrameBatch
from pe_runtime.geometry.cameras import Cameras
from pe_runtime.networks import Codes, SynthesisNetworks
from pe_runtime.rendering.scene import RenderSettings
from pe_runtime.training.augmentation import recolour
from pe_runtime.training.global_statistics import share_statistics
from pe_runtime.training.held_out import Measurement
from pe_runtime.training.loop import (
    BrokenStepError,
    Log,
    learning_rate_share,
    optimiser_tensors,
    restore_optimiser,
)
from pe_runtime.training.octaves import OctaveWindows
from pe_runtime.training.patches import cut, patch_plan
from pe_runtime.training.perceptual import build_perceptual, gradient_distance
from pe_runtime.training.processes import Team, Total

BORDER = 4
"""Pixels at the rim of a patch that the loss leaves out: F sees no neighbours there."""


class SynthesisPhase:
    """Reconstruct patches of frames from their own poses and their neighbours' styles.

    Args:
        networks: What is trained.
        clips: Training sequences.
        held_out: Sequences for measurements, if any.
        config: Losses, patches, rates; batches are those of each process.

    Raises:
        ConfigError: Patches, frame counts or objects that the clips do not have.
        CheckpointError: The VGG's weights cannot be read.
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
        self.team = Team.current()
        if self.team.size > 1:
            share_statistics(networks)
            networks.total = Total.apply
            self.team.spread(networks)
        decoder = list(networks.feature_renderer.parameters())
        taken = {id(p) for p in decoder}
        rest = [p for p in networks.parameters() if id(p) not in taken]
        self.rates = (config.learning_rate, config.renderer_learning_rate)
        self.optimiser = torch.optim.Adam(
            [{"params": rest}, {"params": decoder}], betas=(0.9, 0.99)
        )
        size = (config.patch_height, config.patch_width)
        # Without a ConvNet a pixel is as good at the rim as elsewhere.
        self.rim = 0 if networks.config.feature_renderer.design == "direct" else BORDER
        self.perceptual = build_perceptual(config, min(size) - 2 * self.rim).to(self.device)
        frame = (clips.images.shape[2], clips.images.shape[3])
        self.patches = patch_plan(networks.config, config, clips.players, frame)
        self.octaves = OctaveWindows(networks, config.octaves_until, config.bending_octaves_until)
        self.measurement: Measurement | None = None

    def step(self, progress: float) -> Log:
        """One optimisation step.

        Raises:
            BrokenStepError: The loss or a gradient is not finite; no weight has been changed.
        """
        self.networks.train()
        self.octaves.open(progress)
        rate = self._set_rates(progress)
        everyone = self._sample()
        corners = self.patches.corners(everyone.boxes)
        own = self.team.part(len(everyone.boxes))
        batch = _take(everyone, own).to(self.device)
        if self.team.size > 1:
            # From here on each process draws for itself: other rays, other noise.
            torch.manual_seed(int(torch.randint(2**62, ())) + self.team.rank)
        noise = self._noise(progress)
        with torch.autocast(self.device.type, torch.bfloat16, enabled=self.config.bfloat16):
            images, codes = self._reconstruct(batch, corners[own], noise)
        loss, logs = self._loss(images, cut(batch.images, corners[own], images.shape[-2:]))
        self.optimiser.zero_grad(set_to_none=True)
        (loss + self._anchor(codes)).backward()
        self.team.average_gradients(self.networks.parameters())
        norm = torch.nn.utils.clip_grad_norm_(self.networks.parameters(), self.config.clip)
        logs |= {"loss": float(loss.detach()), "gradient": float(norm), "rate": rate}
        logs = _with_psnr(self.team.means(logs))
        if not all(math.isfinite(each) for each in logs.values()):
            raise BrokenStepError(logs, _evidence(everyone, corners))
        self.optimiser.step()
        return logs

    def _set_rates(self, progress: float) -> float:
        config = self.config
        warmup = config.warmup / config.steps
        share = learning_rate_share(progress, warmup, config.rates, config.last_rate)
        for group, rate in zip(self.optimiser.param_groups, self.rates, strict=True):
            group["lr"] = rate * share
        return self.rates[0] * share

    def _noise(self, progress: float) -> float:
        """Standard deviation of the noise on raw densities at a point of the training."""
        config = self.config
        if not config.density_noise_until:
            return config.density_noise
        return config.density_noise * max(0.0, 1 - progress / config.density_noise_until)

    def _sample(self) -> FrameBatch:
        """Some frames of some sequences, for all processes; the same in each of them.

        Frames of a sequence stay neighbours in the batch.
        """
        count, frames = self.config.sequences * self.team.size, self.config.frames
        clips = torch.randint(len(self.clips), (count,))
        length = self.clips.images.shape[1]
        times = torch.stack([torch.randperm(length)[:frames] for _ in range(len(clips))])
        batch = self.clips.batch(clips.repeat_interleave(frames), times.flatten())
        return replace(batch, images=recolour(batch.images, frames, self.config.recoloured))

    def _reconstruct(
        self, batch: FrameBatch, corners: Int[Tensor, "frames 2"], noise: float
    ) -> tuple[Float[Tensor, "frames 3 height width"], Mapping[str, Codes]]:
        """The patches as they are drawn, and the codes of the frames."""
        config = self.config
        codes = self.networks.encode(batch.images, batch.cameras, batch.boxes)
        shown = codes
        if config.permute_style:
            shown = {name: _permuted(each, config.frames) for name, each in codes.items()}
        settings = RenderSettings(
            near=self.networks.config.near,
            jitter=config.jitter,
            density_noise=noise,
            bucket=1024,
        )
        size = (config.patch_height, config.patch_width)
        images = self.networks.synthesise(batch.cameras, shown, corners, size, settings)
        return images, codes

    def _loss(self, images: Tensor, targets: Tensor) -> tuple[Tensor, Log]:
        height, width = images.shape[-2:]
        inner = (..., slice(self.rim, height - self.rim), slice(self.rim, width - self.rim))
        images, targets = images[inner], targets[inner]
        squared = (images - targets).square().mean()
        gradient = gradient_distance(images, targets)
        perceptual = self.perceptual(images, targets)
        config = self.config
        loss = squared + config.gradient_weight * gradient
        loss = loss + config.perceptual_weight * perceptual
        return loss, {"squared": float(squared.detach()), "perceptual": float(perceptual.detach())}

    def _anchor(self, codes: Mapping[str, Codes]) -> Tensor:
        """Nothing, that depends on the codes of all objects that any of the processes has drawn.

        Gradients of batch statistics are exchanged. A process whose frames do not show an object
        would otherwise never come to that exchange, and the others would wait for ever.
        """
        nothing = torch.zeros((), device=self.device)
        if self.team.size == 1:
            return nothing
        drawn = set(self.networks.drawn(codes))
        flags = self.team.largest(*(float(name in drawn) for name in codes))
        for each, flag in zip(codes.values(), flags, strict=True):
            if flag:
                parts = [each.style, each.pose, *([] if each.heading is None else [each.heading])]
                nothing = nothing + sum(0.0 * part.float().sum() for part in parts)
        return nothing

    def evaluate(self) -> Log:
        """PSNR of whole held-out frames and of player boxes, with own and with another pose."""
        if self.held_out is None:
            return {}
        self.measurement = Measurement(self.networks, self.held_out, self.config.bfloat16)
        return self.measurement.figures

    def sheet(self) -> Float[Tensor, "rows columns 3"] | None:
        """Frames of the last measurement: target, drawn, and drawn with another frame's pose."""
        return None if self.measurement is None else self.measurement.sheet()

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


def _with_psnr(figures: Log) -> Log:
    """Figures with a PSNR in dB in place of the mean squared error."""
    rest = {name: value for name, value in figures.items() if name != "squared"}
    return {"psnr_patch": -10 * math.log10(max(figures["squared"], 1e-10))} | rest


def _permuted(codes: Codes, frames: int) -> Codes:
    """Styles of each sequence rolled along time, so that w cannot carry the pose.

    A frame whose neighbour does not show the object keeps its own style.
    """
    style = codes.style.unflatten(0, (-1, frames)).roll(1, dims=1).flatten(0, 1)
    seen = codes.visible.unflatten(0, (-1, frames)).roll(1, dims=1).flatten(0, 1)
    style = torch.where(seen[:, None], style, codes.style)
    return replace(codes, style=style)


def _take(batch: FrameBatch, which: slice) -> FrameBatch:
    """Some frames of a batch."""
    cameras = batch.cameras
    some = Cameras(
        cameras.width,
        cameras.height,
        cameras.intrinsics[which],
        cameras.world_from_camera[which],
    )
    return FrameBatch(batch.images[which], some, batch.boxes[which])


def _evidence(batch: FrameBatch, corners: Tensor) -> dict[str, Tensor]:
    """A batch as tensors to be stored."""
    return {
        "images": batch.images,
        "intrinsics": batch.cameras.intrinsics,
        "world_from_camera": batch.cameras.world_from_camera,
        "boxes": batch.boxes,
        "corners": corners,
    }
