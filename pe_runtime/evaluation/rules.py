"""The fixed protocol as values; `protocol.toml` is its one home, and its hash goes with reports."""

import hashlib
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from pe_runtime.config import read_toml

FILE = Path(__file__).with_name("protocol.toml")
OWN_DETECTOR = FILE.with_name("people.safetensors")
"""Finds people; trained on recordings of the scene `duel`, see `people.md`."""


@dataclass(frozen=True)
class Rules:
    """How pictures, detections and actions are measured; see the comments in the file."""

    every: int
    clip: int
    quality: str
    slowest_walk: float
    farthest_match: float
    smallest_person: float
    opaque: float
    resamples: int
    seed: int


@dataclass(frozen=True)
class LongPlayRules:
    """How long play is measured; see the comments in the file."""

    steps: int
    early: int
    late: int
    starts: int
    hold: tuple[int, int]
    window: int
    speed_margin: float


RULES: Rules = read_toml(FILE, "rules", Rules)
LONG_PLAY: LongPlayRules = read_toml(FILE, "long_play", LongPlayRules)


def stated_rules() -> dict[str, Any]:
    """The rules and the first 12 digits of the file's SHA-256, for a report."""
    digits = hashlib.sha256(FILE.read_bytes()).hexdigest()[:12]
    return {"hash": digits, "rules": asdict(RULES), "long_play": asdict(LONG_PLAY)}
