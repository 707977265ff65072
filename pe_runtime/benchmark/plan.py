"""What one benchmark measures: models, sections, and how thoroughly."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from pe_runtime.benchmark.jobs import Case, Job, Measurement
from pe_runtime.benchmark.machine import ROWS
from pe_runtime.benchmark.motion import FILMS
from pe_runtime.benchmark.processes import measure
from pe_runtime.benchmark.reference import reference_picture
from pe_runtime.benchmark.scenes import Scene
from pe_runtime.benchmark.seeded import SEEDED_TENNIS

OF_MODELS = ("points", "pixels", "objects", "samples", "frames")
BLENDER = "blender"
SECTIONS = (*OF_MODELS, BLENDER)
DEFAULT_MODELS = ("duel", SEEDED_TENNIS)
QUICK_MODELS = ("duel",)


@dataclass(frozen=True)
class Plan:
    """What is to be measured, and how thoroughly."""

    models: tuple[str, ...] = DEFAULT_MODELS
    start: str | None = None
    """Clip or state file from which all models start; None for each model's own."""
    device: str = "cpu"
    sections: tuple[str, ...] = SECTIONS
    switches: bool = True
    """Every switch on its own, and not the presets alone."""
    frames: int = 8
    """Frames of each film; the first counts apart."""
    repeats: int = 3
    """Fresh processes per point, and rounds of the cost sections."""
    object_rounds: int = 9
    """Rounds of the section "objects": differences of a few per cent need more of them."""
    long_film: int = 500
    """Frames over which the memory may not grow."""
    finer: int = 16
    """Times the samples of the converged integral."""
    shrink: int = 1
    """Pictures are so many times smaller than the model's."""
    product_rows: int = ROWS

    def as_dict(self) -> dict[str, Any]:
        """JSON-able form; of files it keeps the names, since folders are the user's own."""
        named = {
            "models": [name_of(model) for model in self.models],
            "start": None if self.start is None else name_of(self.start),
            "sections": list(self.sections),
        }
        return asdict(self) | named


def name_of(model: str) -> str:
    """A built-in name as it is, a path without its folder and suffix."""
    return Path(model).stem


def quick(plan: Plan) -> Plan:
    """The same in seconds: small pictures, few frames. Says that it works, not how fast it is."""
    models = QUICK_MODELS if plan.models == DEFAULT_MODELS else plan.models
    sections = OF_MODELS if plan.sections == SECTIONS else plan.sections
    small = {"frames": 3, "repeats": 1, "object_rounds": 1, "long_film": 6, "finer": 4}
    small |= {"shrink": 4, "product_rows": ROWS // 50, "switches": False}
    return replace(plan, models=models, sections=sections, **small)


@dataclass(frozen=True)
class Bench:
    """One model at its starting point, ready to be measured.

    Attributes:
        plan: How thoroughly.
        model: Name or file.
        scene: What all films begin with.
        start: State file from which measuring processes begin with the same numbers.
        measure: Carries out jobs; another one in tests.
        step: Called after every job.
    """

    plan: Plan
    model: str
    scene: Scene
    start: str
    measure: Callable[[Job], Measurement] = measure
    step: Callable[[], object] = lambda: None
    known: dict[tuple[str, int, int], np.ndarray] = field(default_factory=dict)
    """True pictures that were drawn already."""

    def truth(self, kind: str, frame: int, finer: int = 1) -> Float[np.ndarray, "height width 3"]:
        """One frame of a film in float64, with so many times the samples."""
        key = (kind, frame, finer)
        if key not in self.known:
            moment = FILMS[kind](self.scene, frame)
            self.known[key] = reference_picture(self.scene.environment, *moment, finer)
        return self.known[key]

    def run(self, cases: tuple[Case, ...], rounds: int = 1) -> Measurement:
        """Measure some cases in one process."""
        plan = self.plan
        job = Job(self.model, self.start, plan.device, cases, rounds, plan.product_rows)
        found = self.measure(job)
        self.step()
        return found
