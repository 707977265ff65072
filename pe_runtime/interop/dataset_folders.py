"""Where the release's data sets keep what: ROOT/{train,val,test}/SEQUENCE/CAMERA/.

A camera's folder holds its pictures 00000.png, 00001.png, ... (or another format) and pickles, one
entry a frame.
"""

from collections.abc import Sequence
from pathlib import Path

from pe_runtime.contract.errors import EpisodeError

SPLITS = ("train", "val", "test")
PICTURES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp")
PICKLES = (
    "cameras",
    "focals",
    "bounding_boxes",
    "bounding_box_validity",
    "actions",
    "object_poses",
    "rewards",
    "dones",
    "metadata",
)
"""The pickles that are read. Others (key points, crop regions) and optical flow are left."""


def find_splits(root: Path, wanted: Sequence[str] | None = None) -> dict[str, Path]:
    """The splits of a data set by name; the name is "" where `root` itself is a split.

    Raises:
        EpisodeError: There is no such folder, or it has none of the splits that are wanted.
    """
    if not root.is_dir():
        raise EpisodeError(f"{root} is no folder; give the data set's, with {', '.join(SPLITS)}")
    unknown = sorted(set(wanted or ()) - set(SPLITS))
    if unknown:
        raise EpisodeError(f"split {unknown[0]!r} is unknown; expected {', '.join(SPLITS)}")
    found = {name: root / name for name in SPLITS if (root / name).is_dir()}
    missing = [name for name in wanted or () if name not in found]
    if missing:
        raise EpisodeError(
            f"{root} has no split {', '.join(missing)}; it has {', '.join(found) or 'none'}"
        )
    return {name: found[name] for name in wanted or found} or {"": root}


def sequence_folders(split: Path) -> list[Path]:
    """The sequences of a split, in order.

    Raises:
        EpisodeError: There are none.
    """
    found = _folders(split)
    if not found:
        raise EpisodeError(
            f"{split} holds no sequences; expected folders such as 00000/00000 with pictures and "
            "cameras.pkl"
        )
    return found


def camera_folders(sequence: Path) -> list[Path]:
    """The cameras of a sequence, in order.

    Raises:
        EpisodeError: There are none, or they have different numbers of pictures.
    """
    found = _folders(sequence)
    if not found:
        where = "; give the folder above it" if (sequence / "cameras.pkl").is_file() else ""
        raise EpisodeError(f"it holds no camera's folder such as 00000{where}")
    return found


def picture_paths(camera: Path) -> list[Path]:
    """A camera's pictures, frame by frame.

    Raises:
        EpisodeError: There are none, or one is missing.
    """
    numbered = [path for path in camera.iterdir() if _is_picture(path)]
    formats = {path.suffix for path in numbered if int(path.stem) == 0}
    if not formats:
        missing = f"picture 00000 is missing in {camera}" if numbered else f"no picture in {camera}"
        raise EpisodeError(f"{missing}; expected 00000.png, 00001.png, ...")
    chosen = min(formats, key=lambda suffix: PICTURES.index(suffix.lower()))
    frames = {int(path.stem): path for path in numbered if path.suffix == chosen}
    gap = next(frame for frame in range(len(frames) + 1) if frame not in frames)
    if gap < len(frames):
        raise EpisodeError(
            f"frame {gap:05d}{chosen} is missing in the middle of {camera}, which goes on to "
            f"frame {max(frames):05d}; copy it from the original again"
        )
    return [frames[frame] for frame in range(len(frames))]


def unread_names(camera: Path, pictures: Sequence[Path]) -> set[str]:
    """What else lies in a camera's folder, such as keypoints.pkl or flow."""
    read = {path.name for path in pictures} | {f"{name}.pkl" for name in PICKLES}
    others = [path for path in camera.iterdir() if path.name not in read]
    return {f"*{path.suffix}" if path.stem.isdecimal() else path.name for path in others}


def _folders(parent: Path) -> list[Path]:
    return sorted(
        path for path in parent.iterdir() if path.is_dir() and not path.name.startswith(".")
    )


def _is_picture(path: Path) -> bool:
    return path.stem.isdecimal() and path.suffix.lower() in PICTURES
