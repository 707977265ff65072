"""Training data on disk: a data set is a folder of episodes, an episode a folder of pictures.

    DATASET/dataset.json             what every episode shares (`DatasetInfo`)
    DATASET/00000/arrays.npz         cameras, boxes, positions, actions (`EpisodeArrays`)
    DATASET/00000/frames/V/TTTT.png  8-bit sRGB; V = view, TTTT = frame, both from 0
    DATASET/00000/masks/V/TTTT.png   8-bit ids: 0 nothing, k + 1 = object k
    DATASET/00000/depth/V/TTTT.npz   `depth` float16, planar z in metres, +inf where nothing is
    DATASET/00000/episode.json       metadata, written last: where it is, the episode is complete

Pixels count from the top-left corner, centres at +0.5; cameras as in `contract.camera`; the world
is right-handed, Z up, in metres. Letters: V views, T frames, P objects.
"""

import json
import os
import zipfile
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path

import numpy as np

from .camera import Camera
from .errors import CameraError, EpisodeError

FORMAT = 1
DATASET_FILE = "dataset.json"
EPISODE_FILE = "episode.json"
ARRAYS_FILE = "arrays.npz"


@dataclass(frozen=True)
class DatasetInfo:
    """What all episodes of a data set have in common.

    Attributes:
        scene: Name of what was recorded.
        seed: Seed of the recording; 0 where nothing was random.
        count: Number of episodes the data set has when complete.
        steps_per_second: Frames per second of the episodes.
        width: Pixel columns.
        height: Pixel rows.
        objects: Names of the playable objects, in the order of the P axis.
        actions: Names of the actions, in the order of their indices; empty if unknown.
        views: Cameras that recorded each frame.
        format: Version of this layout.
    """

    scene: str
    seed: int
    count: int
    steps_per_second: float
    width: int
    height: int
    objects: tuple[str, ...]
    actions: tuple[str, ...]
    views: int
    format: int = FORMAT

    def __post_init__(self) -> None:
        if self.format != FORMAT:
            raise EpisodeError(
                f"data set format {self.format} is unknown, expected {FORMAT}; record it anew or "
                "install the version of this program that wrote it"
            )
        sizes = {"width": self.width, "height": self.height, "views": self.views}
        for name, value in sizes.items():
            if value < 1:
                raise EpisodeError(f"data set {name} is {value}; expected 1 or more")
        if self.count < 0 or not self.steps_per_second > 0:
            raise EpisodeError(
                f"data set count is {self.count} and steps_per_second {self.steps_per_second}; "
                "expected a count of 0 or more and a rate above 0"
            )


@dataclass(frozen=True, eq=False)
class EpisodeArrays:
    """The numbers of one episode.

    Attributes:
        intrinsics: (V, T, 3, 3) float64, pixels.
        world_from_camera: (V, T, 4, 4) float64, OpenCV camera axes.
        boxes: (V, T, P, 4) float32 left, top, right, bottom as pixel edges; NaN where absent.
        present: (V, T, P) bool, whether the object is seen well enough to have a box.
        positions: (T, P, 3) float64 point on the ground, metres.
        actions: (T - 1, P) int8 action taken from t to t + 1; -1 if unknown.
    """

    intrinsics: np.ndarray
    world_from_camera: np.ndarray
    boxes: np.ndarray
    present: np.ndarray
    positions: np.ndarray
    actions: np.ndarray

    def __post_init__(self) -> None:
        _check_arrays(self)

    @property
    def views(self) -> int:
        """Number of cameras."""
        return self.present.shape[0]

    @property
    def frames(self) -> int:
        """Number of frames."""
        return self.present.shape[1]


@dataclass(frozen=True, eq=False)
class Episode:
    """One recorded episode: its numbers in memory, its pictures by path."""

    path: Path
    info: DatasetInfo
    arrays: EpisodeArrays
    metadata: Mapping[str, object] = field(default_factory=dict)

    def frame_path(self, view: int, frame: int) -> Path:
        """The picture, 8-bit sRGB PNG."""
        return frame_path(self.path, view, frame)

    def mask_path(self, view: int, frame: int) -> Path:
        """The ids, 8-bit PNG: 0 nothing, k + 1 = `info.objects[k]`."""
        return mask_path(self.path, view, frame)

    def depth(self, view: int, frame: int) -> np.ndarray:
        """Planar depth (height, width) float16 in metres, +inf where nothing is.

        Raises:
            EpisodeError: If the file is missing, malformed, or of another size.
        """
        path = depth_path(self.path, view, frame)
        depth = _load_npz(path).get("depth")
        expected = (self.info.height, self.info.width)
        if depth is None or depth.shape != expected:
            found = "no array `depth`" if depth is None else f"shape {depth.shape}"
            raise EpisodeError(f"{path}: expected `depth` of shape {expected}, found {found}")
        return depth

    def camera(self, view: int, frame: int) -> Camera:
        """The camera that took the picture."""
        return Camera(
            self.info.width,
            self.info.height,
            self.arrays.intrinsics[view, frame],
            self.arrays.world_from_camera[view, frame],
        )


def episode_path(dataset: Path, number: int) -> Path:
    """Folder of an episode."""
    return dataset / f"{number:05d}"


def frame_path(episode: Path, view: int, frame: int) -> Path:
    """Where an episode keeps a picture."""
    return episode / "frames" / str(view) / f"{frame:04d}.png"


def mask_path(episode: Path, view: int, frame: int) -> Path:
    """Where an episode keeps the ids of a picture."""
    return episode / "masks" / str(view) / f"{frame:04d}.png"


def depth_path(episode: Path, view: int, frame: int) -> Path:
    """Where an episode keeps the depth of a picture."""
    return episode / "depth" / str(view) / f"{frame:04d}.npz"


def is_complete(episode: Path) -> bool:
    """Whether an episode was written to its end."""
    return (episode / EPISODE_FILE).is_file()


def write_dataset(root: Path, info: DatasetInfo) -> None:
    """Write `dataset.json`."""
    root.mkdir(parents=True, exist_ok=True)
    _write_json(root / DATASET_FILE, _info_as_dict(info))


def write_depth(episode: Path, view: int, frame: int, depth: np.ndarray) -> None:
    """Store planar depth (height, width) in metres, +inf where nothing is."""
    path = depth_path(episode, view, frame)
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(path, depth=depth.astype(np.float16))


def write_episode(
    path: Path, info: DatasetInfo, arrays: EpisodeArrays, metadata: Mapping[str, object]
) -> None:
    """Finish an episode whose pictures lie in place: its arrays, then the completing metadata.

    Args:
        path: The episode's folder.
        info: The data set it belongs to.
        arrays: Its numbers.
        metadata: Anything JSON can hold, for people to read.

    Raises:
        EpisodeError: If the arrays do not fit `info`, or a picture is missing.
    """
    _check_fit(path, info, arrays)
    for view in range(arrays.views):
        for frame in range(arrays.frames):
            if not frame_path(path, view, frame).is_file():
                raise EpisodeError(
                    f"{path}: picture {view}/{frame:04d} is missing; write all pictures first"
                )
    path.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(path / ARRAYS_FILE, **{k: getattr(arrays, k) for k in _ARRAY_NAMES})
    facts = {"dataset": _info_as_dict(info), "frames": arrays.frames, "metadata": dict(metadata)}
    _write_json(path / EPISODE_FILE, facts)


def read_episode(path: str | Path) -> Episode:
    """Load an episode's numbers; its pictures stay on disk.

    Raises:
        EpisodeError: If it is missing, incomplete or malformed.
    """
    path = Path(path)
    if not is_complete(path):
        raise EpisodeError(
            f"{path} is no complete episode: {EPISODE_FILE} is missing; record it again"
        )
    facts = _read_json(path / EPISODE_FILE)
    unknown = set(facts) ^ {"dataset", "frames", "metadata"}
    if unknown:
        raise EpisodeError(f"{path / EPISODE_FILE}: unknown or missing keys {sorted(unknown)}")
    info = _info_from_dict(facts["dataset"], str(path / EPISODE_FILE))
    stored = _load_npz(path / ARRAYS_FILE)
    if set(stored) != set(_ARRAY_NAMES):
        raise EpisodeError(
            f"{path / ARRAYS_FILE}: expected {sorted(_ARRAY_NAMES)}, found {sorted(stored)}"
        )
    try:
        arrays = EpisodeArrays(**stored)
    except EpisodeError as error:
        raise EpisodeError(f"{path / ARRAYS_FILE}: {error}") from error
    _check_fit(path, info, arrays)
    return Episode(path, info, arrays, facts["metadata"])


def read_info(root: str | Path) -> DatasetInfo:
    """Read `dataset.json`.

    Raises:
        EpisodeError: If it is missing or malformed.
    """
    file = Path(root) / DATASET_FILE
    if not file.is_file():
        raise EpisodeError(f"{root} is no data set: {DATASET_FILE} is missing; give its folder")
    return _info_from_dict(_read_json(file), str(file))


def read_dataset(root: str | Path) -> tuple[DatasetInfo, list[Path]]:
    """What a data set holds and the folders of its complete episodes, in order.

    Raises:
        EpisodeError: If `dataset.json` is missing or malformed.
    """
    info = read_info(root)
    folders = sorted(p for p in Path(root).iterdir() if p.name.isdigit() and is_complete(p))
    return info, folders


_ARRAY_NAMES = tuple(f.name for f in fields(EpisodeArrays))
_DTYPES = {
    "intrinsics": np.float64,
    "world_from_camera": np.float64,
    "boxes": np.float32,
    "present": np.bool_,
    "positions": np.float64,
    "actions": np.int8,
}


def _check_arrays(arrays: EpisodeArrays) -> None:
    for name, dtype in _DTYPES.items():
        found = getattr(arrays, name)
        if found.dtype != dtype:
            raise EpisodeError(f"{name} is {found.dtype}; expected an array of {np.dtype(dtype)}")
    if arrays.present.ndim != 3:
        raise EpisodeError(f"present has shape {arrays.present.shape}; expected (V, T, P)")
    v, t, p = arrays.present.shape
    shapes = {
        "intrinsics": (v, t, 3, 3),
        "world_from_camera": (v, t, 4, 4),
        "boxes": (v, t, p, 4),
        "positions": (t, p, 3),
        "actions": (max(t - 1, 0), p),
    }
    for name, shape in shapes.items():
        if getattr(arrays, name).shape != shape:
            raise EpisodeError(
                f"{name} has shape {getattr(arrays, name).shape}; expected {shape} for {v} views, "
                f"{t} frames and {p} objects"
            )
    for name in ("intrinsics", "world_from_camera", "positions"):
        if not np.isfinite(getattr(arrays, name)).all():
            raise EpisodeError(f"{name} holds NaN or infinity; every frame needs its numbers")
    if not np.array_equal(np.isfinite(arrays.boxes).all(-1), arrays.present):
        raise EpisodeError("boxes are finite where `present` says absent, or the reverse")


def _check_fit(path: Path, info: DatasetInfo, arrays: EpisodeArrays) -> None:
    views, _, objects = arrays.present.shape
    if (views, objects) != (info.views, len(info.objects)):
        raise EpisodeError(
            f"{path}: arrays hold {views} views of {objects} objects, the data set says "
            f"{info.views} views of {len(info.objects)}"
        )
    highest = arrays.actions.max(initial=-1)
    if arrays.actions.min(initial=0) < -1 or (info.actions and highest >= len(info.actions)):
        raise EpisodeError(
            f"{path}: actions run from {arrays.actions.min()} to {highest}; expected -1 (unknown) "
            f"to {len(info.actions) - 1}"
        )
    for pose, intrinsics in zip(
        arrays.world_from_camera.reshape(-1, 4, 4), arrays.intrinsics.reshape(-1, 3, 3), strict=True
    ):
        try:
            Camera(info.width, info.height, intrinsics, pose)
        except CameraError as error:
            raise EpisodeError(f"{path}: {error}") from error


def _info_as_dict(info: DatasetInfo) -> dict:
    facts = asdict(info)
    return facts | {"objects": list(info.objects), "actions": list(info.actions)}


def _info_from_dict(facts: object, where: str) -> DatasetInfo:
    expected = {
        "scene": str, "seed": int, "count": int, "steps_per_second": (int, float), "width": int,
        "height": int, "objects": list, "actions": list, "views": int, "format": int,
    }  # fmt: skip
    if not isinstance(facts, dict) or set(facts) != set(expected):
        found = sorted(facts) if isinstance(facts, dict) else type(facts).__name__
        raise EpisodeError(f"{where}: expected the keys {sorted(expected)}, found {found}")
    for name, kind in expected.items():
        if not isinstance(facts[name], kind) or isinstance(facts[name], bool):
            raise EpisodeError(f"{where}: {name} is {facts[name]!r}, of the wrong type")
    for name in ("objects", "actions"):
        if not all(isinstance(entry, str) for entry in facts[name]):
            raise EpisodeError(f"{where}: {name} is {facts[name]!r}; expected a list of names")
    lists = {"objects": tuple(facts["objects"]), "actions": tuple(facts["actions"])}
    return DatasetInfo(**{**facts, **lists, "steps_per_second": float(facts["steps_per_second"])})


def _load_npz(path: Path) -> dict[str, np.ndarray]:
    try:
        # Opened here, because numpy leaves the file of a damaged archive open.
        with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            return {name: stored[name] for name in stored.files}
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise EpisodeError(f"{path} cannot be read: {error}; record the episode again") from error


def _read_json(path: Path) -> dict:
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise EpisodeError(f"{path} cannot be read as JSON: {error}; record it again") from error
    if not isinstance(found, dict):
        raise EpisodeError(f"{path} holds {type(found).__name__}; expected a JSON object")
    return found


def _write_json(path: Path, facts: dict) -> None:
    # Processes that record one data set may write its description at the same moment.
    part = path.with_name(f"{path.name}.{os.getpid()}.part")
    part.write_text(json.dumps(facts, indent=1) + "\n", encoding="utf-8")
    part.replace(path)
