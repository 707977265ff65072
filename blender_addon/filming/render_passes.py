"""The passes of a frame as Blender knows them: their names, their channels, their numbers."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pe_runtime.contract.shot import (
    BACKGROUND_PASS,
    DEPTH_PASS,
    LAYER_PASS_PREFIX,
    MASK_PASS_PREFIX,
)

from ..worker.replies import RenderedFrame
from .pixels import PassMemory

COMBINED, DEPTH, BACKGROUND = "Combined", "Depth", "Background"
MASK_PREFIX, LAYER_PREFIX = "Mask ", "Layer "
NAME_BYTES = 63
"""Blender cuts off what is longer, and then nobody finds the pass."""


@dataclass(frozen=True)
class BlenderPass:
    """How a pass is registered.

    Attributes:
        name: What sockets and files call it.
        channels: One letter each.
        kind: Blender's type of pass.
    """

    name: str
    channels: str
    kind: str


def blender_pass(name: str) -> BlenderPass:
    """What Blender is told of a pass of a Shot."""
    if name == DEPTH_PASS:
        return BlenderPass(DEPTH, "Z", "VALUE")
    if name == BACKGROUND_PASS:
        return BlenderPass(BACKGROUND, "RGBA", "COLOR")
    if name.startswith(LAYER_PASS_PREFIX):
        return BlenderPass(layer_name(name.removeprefix(LAYER_PASS_PREFIX)), "RGBA", "COLOR")
    return BlenderPass(mask_name(name.removeprefix(MASK_PASS_PREFIX)), "X", "VALUE")


def mask_name(target: str) -> str:
    """The pass with the mask of a playable object."""
    return _short_enough(MASK_PREFIX + target)


def layer_name(target: str) -> str:
    """The pass with a playable object alone."""
    return _short_enough(LAYER_PREFIX + target)


def pass_numbers(
    drawn: RenderedFrame, memory: PassMemory, scale: float
) -> Iterator[tuple[str, np.ndarray]]:
    """The numbers of every pass that was drawn; each is gone when the next one comes.

    Args:
        drawn: A frame of the worker.
        memory: Of the frame's size.
        scale: Scene metres per environment metre.
    """
    yield COMBINED, memory.combined(drawn.rgb)
    if drawn.depth is not None:
        yield DEPTH, memory.depth(drawn.depth, scale)
    for name, mask in drawn.masks.items():
        yield mask_name(name), memory.values(mask)
    for name, layer in drawn.layers.items():
        yield layer_name(name), memory.layer(layer)
    if drawn.background is not None:
        yield BACKGROUND, memory.combined(drawn.background)


def _short_enough(name: str) -> str:
    return name.encode()[:NAME_BYTES].decode(errors="ignore")
