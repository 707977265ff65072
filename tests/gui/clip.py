"""The first picture of the built-in model's own clip: boxes, and where it shows the ground."""

import json
from pathlib import Path

import numpy as np

_CLIP = next((Path(__file__).parents[2] / "pe_runtime" / "models" / "duel_clip").glob("0*"))
_OBJECTS = json.loads((_CLIP / "episode.json").read_text())["dataset"]["objects"]
PICTURE = _CLIP / "frames" / "0" / "0000.png"

with np.load(_CLIP / "arrays.npz") as _arrays:
    BOXES = {
        name: tuple(float(edge) for edge in _arrays["boxes"][0, 0, index])
        for index, name in enumerate(_OBJECTS)
        if _arrays["present"][0, 0, index]
    }
    _INTRINSICS = _arrays["intrinsics"][0, 0].astype(float)
    _POSE = _arrays["world_from_camera"][0, 0].astype(float)


def pixel_of(x: float, y: float) -> tuple[float, float]:
    """Where the picture shows a place of the ground, metres."""
    in_camera = (np.array([x, y, 0.0]) - _POSE[:3, 3]) @ _POSE[:3, :3]
    u, v, w = _INTRINSICS @ in_camera
    return float(u / w), float(v / w)
