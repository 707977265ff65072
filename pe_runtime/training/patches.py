"""Where the patches of a training batch lie."""

from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from torch import Tensor

from pe_runtime.config import ModelConfig, SynthesisConfig
from pe_runtime.contract.errors import ConfigError


@dataclass(frozen=True)
class PatchPlan:
    """How patches are laid.

    Attributes:
        weights: How often around which player, relative to each other.
        share: Of the patches that are laid around a player at all.
        places: See `SynthesisConfig.patch_places`.
        patch: Height and width, pixels.
        frame: Height and width of the pictures, pixels.
        grid: Corners are multiples of it, pixels.
    """

    weights: Float[Tensor, " players"]
    share: float
    places: str
    patch: tuple[int, int]
    frame: tuple[int, int]
    grid: int

    def corners(self, boxes: Float[Tensor, "frames players 4"]) -> Int[Tensor, "frames 2"]:
        """Draw the top-left corner (row, column) of one patch for each frame.

        Args:
            boxes: (left, top, right, bottom), pixels. Players without a box, or with one that
                covers nothing of the picture, are not looked for.
        """
        limit = torch.tensor([f - p for f, p in zip(self.frame, self.patch, strict=True)])
        corners = torch.stack([self._corner(each) for each in boxes.cpu()])
        corners = torch.minimum(corners.clamp(min=0), limit.float())
        return (corners / self.grid).floor().long() * self.grid

    def _corner(self, boxes: Float[Tensor, "players 4"]) -> Float[Tensor, "2"]:
        size, frame = torch.tensor(self.patch).float(), torch.tensor(self.frame).float()
        anywhere = torch.rand(2) * (frame - size)
        seen = _within(boxes, frame)
        extent = seen[:, 1] - seen[:, 0]
        area = extent.prod(dim=-1)
        chances = self.weights * ((area > 0) if self.places != "uniform" else area)
        if not len(boxes) or not float(chances.sum()) > 0 or float(torch.rand(())) >= self.share:
            return anywhere
        chosen = int(torch.multinomial(chances, 1))
        if self.places == "middle":
            left, top, right, bottom = boxes[chosen]
            middle = torch.stack([top + bottom, left + right]) / 2
            return middle - size / 2 + (torch.rand(2) - 0.5) * size / 2
        return seen[chosen, 0] + torch.rand(2) * extent[chosen] - size / 2


def patch_plan(
    model: ModelConfig, config: SynthesisConfig, players: tuple[str, ...], frame: tuple[int, int]
) -> PatchPlan:
    """The plan of a training.

    Args:
        model: Knows the players' classes.
        config: Sizes and weights.
        players: Whose boxes the data hold.
        frame: Height and width of the pictures, pixels.

    Raises:
        ConfigError: A weight of something that is neither a playable object nor its class.
    """
    classes = {each.name: each.class_name for each in model.objects if each.name in players}
    known = {*players, *classes.values()}
    unknown = sorted(set(config.patch_weights) - known)
    if unknown:
        raise ConfigError(
            f"synthesis.patch_weights: {unknown[0]!r} is no playable object or class; known: "
            f"{', '.join(sorted(known)) or 'none'}"
        )
    given = config.patch_weights
    weights = [given.get(name, given.get(classes.get(name, name), 1.0)) for name in players]
    return PatchPlan(
        torch.tensor(weights, dtype=torch.float32),
        config.player_patches,
        config.patch_places,
        (config.patch_height, config.patch_width),
        frame,
        model.feature_renderer.strides[-1],
    )


def cut(
    images: Float[Tensor, "frames 3 _ _"], corners: Int[Tensor, "frames 2"], size: tuple[int, int]
) -> Float[Tensor, "frames 3 height width"]:
    """The patches themselves.

    Args:
        images: Whole frames.
        corners: Top row and left column of each patch.
        size: Height and width, pixels.
    """
    pieces = [
        image[:, top : top + size[0], left : left + size[1]]
        for image, (top, left) in zip(images, corners.tolist(), strict=True)
    ]
    return torch.stack(pieces)


def _within(boxes: Tensor, frame: Tensor) -> Float[Tensor, "players 2 2"]:
    """First and last (row, column) of what boxes cover of the picture; without extent if nothing.

    NaN and infinity, which stand for "not found", cover nothing.
    """
    known = torch.isfinite(boxes).all(dim=-1)[:, None]
    boxes = torch.where(known, boxes, 0.0)
    first = torch.minimum(boxes[:, [1, 0]].clamp(min=0), frame)
    last = torch.minimum(boxes[:, [3, 2]].clamp(min=0), frame)
    return torch.stack([first, torch.maximum(first, last)], dim=1)
