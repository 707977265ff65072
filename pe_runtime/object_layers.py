"""Objects one by one: each alone on the background, cut out, and the background without any.

A ConvNet draws the picture, so no object has pixels of its own. A layer's colours are those that,
laid over the background in linear light, give the picture of the object alone.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from pe_runtime.images import linear_from_srgb, srgb_from_linear
from pe_runtime.kept_frames import Frame
from pe_runtime.render_options import RenderOptions
from pe_runtime.state import EnvironmentState, hide

FAINT = 1 / 255
"""Least alpha at which a colour can be told from the background's."""

Draw = Callable[[EnvironmentState, RenderOptions], Frame]


def with_layers(
    draw: Draw, state: EnvironmentState, options: RenderOptions, playable: Sequence[str]
) -> Frame:
    """A frame with its layers and its background.

    Args:
        draw: Draws a state, without layers.
        state: What stands where.
        options: What is wanted.
        playable: All playable objects.
    """
    plain = replace(options, layers=(), background=False)
    frame = draw(state, plain)
    beside = replace(plain, depth=False, masks=())
    background = draw(_only((), state, playable), beside)
    layers = {}
    for name in options.layers:
        alone = draw(_only((name,), state, playable), replace(beside, masks=(name,)))
        layers[name] = cut_out(alone.rgb, background.rgb, alone.masks[name])
    parts = {"layers": layers, "background": background.rgb if options.background else None}
    return replace(frame, **parts)


def cut_out(picture: np.ndarray, background: np.ndarray, alpha: np.ndarray) -> np.ndarray:
    """What has to lie over the background to give the picture.

    Args:
        picture: (height, width, 3) sRGB in [0, 1].
        background: The same without the object.
        alpha: (height, width) share of the object in each pixel.

    Returns:
        (height, width, 4) float32 sRGB with straight alpha, in [0, 1].
    """
    alpha = np.clip(alpha, 0.0, 1.0).astype(np.float32)
    share = np.maximum(alpha, FAINT)[..., None]
    behind = linear_from_srgb(background) * (1.0 - share)
    colour = np.clip((linear_from_srgb(picture) - behind) / share, 0.0, 1.0)
    return np.dstack([srgb_from_linear(colour), alpha]).astype(np.float32)


def _only(
    shown: Sequence[str], state: EnvironmentState, playable: Sequence[str]
) -> EnvironmentState:
    for name in playable:
        if name not in shown:
            state = hide(state, name)
    return state
