"""Frames that need not be drawn again, because everything that decides them is as it was."""

import mmap
from collections import OrderedDict
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

LIMIT = 8 * 2**20
"""Bytes of pictures that are kept: 4 of 512x288, or 18 of 256x144, without further passes."""


@dataclass(frozen=True)
class Frame:
    """A rendered frame.

    Attributes:
        rgb: (height, width, 3) float32 sRGB in [0, 1].
        depth: (height, width) float32 planar metres, +inf where nothing solid is; None unasked.
        masks: Object name -> (height, width) float32 share of the pixel, in [0, 1].
        layers: Object name -> (height, width, 4) float32 sRGB with straight alpha: it alone.
        background: (height, width, 3) float32 sRGB without playable objects; None unasked.
        statistics: What it cost: rays, composed_rays, hits, field_samples, feature_samples,
            kept_objects, kept_frames.
    """

    rgb: np.ndarray
    depth: np.ndarray | None = None
    masks: Mapping[str, np.ndarray] = field(default_factory=dict)
    statistics: Mapping[str, int] = field(default_factory=dict)
    layers: Mapping[str, np.ndarray] = field(default_factory=dict)
    background: np.ndarray | None = None

    @property
    def nbytes(self) -> int:
        """Bytes of its arrays."""
        arrays = [self.rgb, *self.masks.values(), *([] if self.depth is None else [self.depth])]
        return sum(each.nbytes for each in arrays)


class KeptFrames:
    """The frames drawn last, by all that decides them; the oldest give way.

    Args:
        limit: Bytes of pictures that are kept at most; the last frame is kept however large.
    """

    def __init__(self, limit: int = LIMIT) -> None:
        self.limit = limit
        self._frames: OrderedDict[Hashable, Frame] = OrderedDict()

    def get(self, key: Hashable) -> Frame | None:
        """The frame of a key, at no cost but a copy; None if it has to be drawn."""
        found = self._frames.get(key)
        if found is None:
            return None
        self._frames.move_to_end(key)
        nothing = dict.fromkeys(found.statistics, 0)
        return replace(_copied(found), statistics=nothing | {"kept_frames": 1})

    def keep(self, key: Hashable, frame: Frame) -> None:
        """Remember a copy of a frame, and forget the oldest beyond the limit."""
        self._frames[key] = _copied(frame, _apart)
        held = sum(each.nbytes for each in self._frames.values())
        while held > self.limit and len(self._frames) > 1:
            held -= self._frames.popitem(last=False)[1].nbytes

    def clear(self) -> None:
        """Forget all."""
        self._frames.clear()


def _copied(frame: Frame, copy: Callable[[np.ndarray], np.ndarray] = np.copy) -> Frame:
    """The same numbers in arrays of their own, which nobody else can change."""
    return replace(
        frame,
        rgb=copy(frame.rgb),
        depth=None if frame.depth is None else copy(frame.depth),
        masks={name: copy(mask) for name, mask in frame.masks.items()},
    )


def _apart(array: np.ndarray) -> np.ndarray:
    """A copy in memory of its own.

    Among the short-lived arrays of a renderer, those that stay would keep the rest of the memory
    around them from being used again in one piece.
    """
    if array.nbytes == 0:
        return array.copy()
    copy = np.frombuffer(mmap.mmap(-1, array.nbytes), array.dtype).reshape(array.shape)
    copy[:] = array
    return copy
