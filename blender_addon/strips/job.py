"""One range of frames of a scene, and the files that it becomes."""

import uuid
from dataclasses import dataclass
from pathlib import Path

import bpy

from pe_runtime.contract.errors import ShotError

DIGITS = 4
PREFIX = "frame_"


@dataclass(frozen=True)
class RangeJob:
    """One range of frames on its way to disk.

    Attributes:
        scene_name: Name and not the scene: undo and loading invalidate references.
        folder: Where the PNG files go.
        frame_start: First frame.
        frame_end: Last frame, inclusive.
        id: Ties the frames and their strip to the scene, across renames.
    """

    scene_name: str
    folder: Path
    frame_start: int
    frame_end: int
    id: str = ""

    @property
    def frames(self) -> range:
        """The frames in order."""
        return range(self.frame_start, self.frame_end + 1)

    @property
    def files(self) -> list[Path]:
        """The pictures in order."""
        return [self.file(frame) for frame in self.frames]

    def file(self, frame: int) -> Path:
        """The picture of one frame."""
        return self.folder / file_name(frame)


def file_name(frame: int) -> str:
    """What Blender makes of `frame_####`."""
    return f"{PREFIX}{frame:0{DIGITS}d}.png"


def job_for(scene: bpy.types.Scene, folder: str, frames: tuple[int, int] | None = None) -> RangeJob:
    """The job that renders a scene's frames into a folder.

    Args:
        scene: The scene with the environment.
        folder: Absolute, or relative to the .blend.
        frames: First and last frame; None for the scene's own range.

    Raises:
        ShotError: The folder is relative to a .blend that was never saved, frames are skipped, or
            the range is empty.
    """
    if not folder or (folder.startswith("//") and not bpy.data.filepath):
        raise ShotError(
            f"the frames folder {folder!r} is relative to a file that is not saved yet; save the "
            ".blend or choose an absolute folder"
        )
    if scene.frame_step != 1:
        raise ShotError(
            f"the scene renders every {scene.frame_step}th frame, which a strip would play too "
            "fast; set the frame step to 1"
        )
    first, last = frames or (scene.frame_start, scene.frame_end)
    if last < first:
        raise ShotError(f"expected a range of frames, found {first} to {last}; swap the two")
    absolute = Path(bpy.path.abspath(folder)).resolve()
    return RangeJob(scene.name, absolute, first, last, scene.playable_environment.job)


def claim_job(scene: bpy.types.Scene) -> str:
    """The scene's job, named where it has no name and named anew where it is another scene's.

    A duplicated scene carries the name of the original's job; of two the later one in Blender's
    list, which is the copy, gets a name of its own. Main thread only.
    """
    settings = scene.playable_environment
    namesakes = [each for each in bpy.data.scenes if _has_job(each, settings.job)]
    if not settings.job or (namesakes and namesakes[0] != scene):
        settings.job = uuid.uuid4().hex
    return settings.job


def scene_of(job: str, name: str = "") -> bpy.types.Scene | None:
    """The scene that a job renders; `name` decides where a copy has the same job."""
    named = bpy.data.scenes.get(name)
    if named is not None and _has_job(named, job):
        return named
    return next((each for each in bpy.data.scenes if _has_job(each, job)), None)


def source_of(job: RangeJob) -> bpy.types.Scene:
    """The scene of a job that is under way, which may have been renamed meanwhile.

    Raises:
        ShotError: It was deleted.
    """
    scene = scene_of(job.id, job.scene_name)
    if scene is None:
        raise ShotError(f"the scene {job.scene_name!r} was deleted while its range was rendered")
    return scene


def _has_job(scene: bpy.types.Scene, job: str) -> bool:
    return bool(job) and scene.playable_environment.job == job
