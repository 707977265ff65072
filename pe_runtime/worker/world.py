"""What the worker serves: the verbs of a world, and the values that they answer with."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np

from pe_runtime.contract.camera import Camera
from pe_runtime.contract.model_facts import ModelFacts
from pe_runtime.contract.shot import Shot
from pe_runtime.contract.shot_track import Box


@dataclass(frozen=True)
class Picture:
    """One drawn frame as it travels: bytes for the picture, floats for the passes."""

    number: int
    buffers: dict[str, np.ndarray]
    """rgb and background uint8 (height, width, 3); depth float32 and 'mask:NAME' float32 (height,
    width); 'layer:NAME' uint8 (height, width, 4)."""
    seconds: float = 0.0
    """How long drawing it took, without the way to bytes."""


@runtime_checkable
class World(Protocol):
    """What the worker serves: a trained environment, or the fake one."""

    def load(self, model: str) -> ModelFacts:
        """Make a model ready."""

    def encode(self, image: np.ndarray, camera: Camera, boxes: Mapping[str, Box]) -> dict[str, Any]:
        """State of a picture, uint8 (height, width, 3), as JSON values."""

    def rollout(self, shot: Shot) -> dict[str, np.ndarray]:
        """Predicted paths as the buffers of the reply to ``rollout``."""

    def render(self, shot: Shot, frames: list[int], whole: Shot | None = None) -> Iterator[Picture]:
        """Draw frames of the shot one by one.

        Args:
            shot: What is drawn.
            frames: Frames of it.
            whole: The shot that this one is a part of; its prediction holds, not the part's own.
        """

    def digests(self, shot: Shot, whole: Shot | None = None) -> dict[int, str]:
        """Per frame a hex digest over everything that decides its pixels; arguments as `render`."""

    def infer_actions(
        self, states: list[dict[str, Any]], cameras: list[Camera]
    ) -> dict[str, list[int]]:
        """The action of each playable object from every state to the next, states as JSON."""

    def detect(self, image: np.ndarray, names: list[str]) -> dict[str, tuple[Box, float]]:
        """Box in pixels and score from 0 to 1 of each named object that is found in a picture."""

    def proxy_mesh(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """A stand-in for the viewport: vertices (n, 3) float32, faces (m, 3) int32."""


def box_mesh(
    low: tuple[float, float, float], high: tuple[float, float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (8, 3) float32 and outward triangles (12, 3) int32 of an upright box, metres."""
    corners = np.array(np.meshgrid(*zip(low, high, strict=True), indexing="ij"), np.float32)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))]
    return corners.reshape(3, 8).T.copy(), np.array(triangles, np.int32)
