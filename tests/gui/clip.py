"""The first picture of the built-in model's own clip, with its boxes; without the runtime."""

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
