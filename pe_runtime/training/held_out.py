"""How good a synthesis module is at sequences that it was not trained on, in figures and to see."""

from collections.abc import Mapping
from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from pe_runtime.dataset import Clips, FrameBatch
from pe_runtime.networks import Codes, SynthesisNetworks
from pe_runtime.rendering.scene import RenderSettings

MEASURED_CLIPS = 8
TIMES = 3
"""Frames of each clip, spread over its length."""
SHOWN_CLIPS = 2
GAP = 2
"""White pixels between the pictures of a sheet."""


class Measurement:
    """What whole held-out frames look like when they are drawn again.

    Args:
        networks: Put into evaluation mode.
        clips: The sequences; the first of them are looked at.
        bfloat16: Whether they are drawn in the precision of training.

    Attributes:
        figures: PSNR in dB of frames, of player boxes, and of those with another frame's pose.
        rows: Target, drawn, and drawn with another frame's pose, of some frames.
    """

    def __init__(self, networks: SynthesisNetworks, clips: Clips, bfloat16: bool) -> None:
        networks.eval()
        self.networks = networks
        self.errors: dict[str, list[Tensor]] = {}
        self.rows: list[Float[Tensor, "3 3 height width"]] = []
        device = next(networks.parameters()).device
        times = torch.linspace(0, clips.images.shape[1] - 1, TIMES).long()
        with torch.no_grad(), torch.autocast(device.type, torch.bfloat16, enabled=bfloat16):
            for clip in range(min(len(clips), MEASURED_CLIPS)):
                self._measure(clips.batch(torch.full_like(times, clip), times).to(device), clip)
        means = {name: torch.stack(each).mean() for name, each in self.errors.items()}
        self.figures = {name: float(-10 * mean.log10()) for name, mean in means.items()}

    def sheet(self) -> Float[Tensor, "rows columns 3"]:
        """The rows below each other as one picture in [0, 1]."""
        bands = [
            torch.cat(
                [torch.nn.functional.pad(each, (0, GAP, 0, GAP), value=1.0) for each in row], 2
            )
            for row in self.rows
        ]
        return torch.cat(bands, dim=1).permute(1, 2, 0)[:-GAP, :-GAP]

    def _measure(self, batch: FrameBatch, clip: int) -> None:
        codes = self.networks.encode(batch.images, batch.cameras, batch.boxes)
        other = {n: replace(c, pose=c.pose.roll(1, 0)) for n, c in codes.items()}
        drawn, swapped = self._draw(batch, codes), self._draw(batch, other)
        squares = (drawn - batch.images).square().mean(dim=1)
        with_other = (swapped - batch.images).square().mean(dim=1)
        self._note("psnr", squares)
        for index, box in ((i, b) for i, boxes in enumerate(batch.boxes) for b in boxes):
            if not torch.isfinite(box).all():
                continue
            left, top, right, bottom = box.round().int().clamp(min=0).tolist()
            region = (index, slice(top, bottom), slice(left, right))
            if squares[region].numel() > 0:
                self._note("psnr_box", squares[region])
                self._note("psnr_box_other_pose", with_other[region])
        if clip < SHOWN_CLIPS:
            triples = torch.stack([batch.images, drawn, swapped], dim=1)
            self.rows += list(triples.float().clamp(0, 1).cpu())

    def _note(self, name: str, squares: Tensor) -> None:
        self.errors.setdefault(name, []).append(squares.mean())

    def _draw(self, batch: FrameBatch, codes: Mapping[str, Codes]) -> Tensor:
        corners = torch.zeros(len(batch.cameras), 2, dtype=torch.long)
        size = (batch.cameras.height, batch.cameras.width)
        settings = RenderSettings(near=self.networks.config.near)
        return self.networks.synthesise(batch.cameras, codes, corners, size, settings)
