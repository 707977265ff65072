"""What is measured with: the stand-ins that are always there, and what a user's files add."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from pe_runtime.contract.episode import Episode
from pe_runtime.contract.errors import ConfigError
from pe_runtime.environment import RenderOptions
from pe_runtime.evaluation.detection import (
    Detector,
    FrameDetections,
    HistogramDetector,
    compare,
    held_against,
)
from pe_runtime.evaluation.detector_network import component_boxes, load_detector
from pe_runtime.evaluation.learnt_features import (
    InceptionFeatures,
    Lpips,
    WeightFiles,
    load_lpips,
)
from pe_runtime.evaluation.random_features import RandomPerception
from pe_runtime.evaluation.rules import OWN_DETECTOR, RULES
from pe_runtime.evaluation.subject import boxes_of
from pe_runtime.kept_frames import Frame

DETECTORS = ("own", "hog", "masks", "none")

Distance = Callable[[np.ndarray, np.ndarray], float]
Features = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Instruments:
    """What is measured with.

    Attributes:
        detector: Finds people in recorded and drawn pictures; None for none.
        by_masks: Boxes come from the model's own masks and the recorder's truth instead.
        lpips: Only with the user's files.
        inception: Only with the user's file.
        perception: The stand-ins.
    """

    detector: Detector | None = None
    by_masks: bool = False
    lpips: Lpips | None = None
    inception: InceptionFeatures | None = None
    perception: RandomPerception = field(default_factory=RandomPerception)

    @property
    def detector_name(self) -> str:
        """How a report calls the detector."""
        if self.by_masks:
            return "masks"
        return self.detector.name if self.detector is not None else "none"

    def options(self, players: Sequence[str]) -> RenderOptions:
        """What a frame has to hold."""
        return RenderOptions(RULES.quality, masks=tuple(players) if self.by_masks else ())

    def detections(
        self, frame: Frame, recorded: np.ndarray, episode: Episode, place: tuple[int, int]
    ) -> list[FrameDetections]:
        """Detections in a drawn frame held against the recorded picture's; none without a detector.

        Args:
            frame: Drawn, with `rgb` and `masks`.
            recorded: The picture.
            episode: Where it was recorded.
            place: View and frame there.
        """
        if self.by_masks:
            view, number = place
            wanted = list(boxes_of(episode, number, view).values())
            shown = [component_boxes(mask > RULES.opaque) for mask in frame.masks.values()]
            largest = [boxes[0] for boxes in shown if boxes]
            return [held_against(wanted, largest, recorded.shape[1])]
        return [compare(self.detector, frame.rgb, recorded)] if self.detector is not None else []

    def distances(self) -> dict[str, Distance]:
        """Distances of pairs of pictures, by name."""
        found: dict[str, Distance] = {"lpips_r": self.perception.distance}
        return found | ({"lpips": self.lpips.distance} if self.lpips is not None else {})

    def of_frames(self) -> dict[str, Features]:
        """Features of frames, by the name of the distance that they serve."""
        found: dict[str, Features] = {"fd_r": self.perception.of_frames}
        return found | ({"fid": self.inception.of_frames} if self.inception is not None else {})

    def of_clips(self) -> dict[str, Features]:
        """Features of clips, by the name of the distance that they serve."""
        return {"fvd_r": partial(self.perception.of_clips, length=RULES.clip)}


def set_up(
    detector: str = "own", detector_file: Path | None = None, files: WeightFiles | None = None
) -> Instruments:
    """The instruments that a user asked for.

    Args:
        detector: One of `DETECTORS`.
        detector_file: What `pe train detector` wrote, instead of the one that comes along.
        files: Weights of the user's.

    Raises:
        ConfigError: There is no such detector, or a package or a file is missing.
    """
    files = files or WeightFiles()
    made: Mapping[str, Callable[[], Detector | None]] = {
        "own": lambda: load_detector(detector_file or OWN_DETECTOR),
        "hog": HistogramDetector,
        "masks": lambda: None,
        "none": lambda: None,
    }
    if detector not in made:
        raise ConfigError(f"detector must be one of {', '.join(DETECTORS)}, found {detector!r}")
    return Instruments(
        made[detector](),
        detector == "masks",
        load_lpips(files),
        InceptionFeatures(files.inception) if files.inception is not None else None,
    )
