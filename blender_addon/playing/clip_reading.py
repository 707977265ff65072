"""The pictures of a strip or a movie clip, with the camera and the tracked boxes at their frames.

Sources are kept by name: what Blender calls an object may be another one at the next tick.
"""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from pe_runtime.contract.errors import ShotError

from ..framing.cameras import check_shape
from ..framing.strip_frames import PICTURED, StripFrame
from ..framing.tracked_boxes import tracked_box
from ..pictures import read_picture
from ..scene_bridge import read_camera
from ..strips.timing import span
from .clip_actions import Box, ClipFrame
from .stand_in import stand_in_for


@dataclass(frozen=True)
class ClipSource:
    """Where the pictures come from.

    Attributes:
        scene: Name of the scene that is played.
        edit: Name of the scene with the strip; empty for a clip.
        name: The strip's name, or the clip's.
        tracked: The objects whose boxes come from tracks; None to have all looked for.
    """

    scene: str
    edit: str
    name: str
    tracked: tuple[str, ...] | None

    def picture_at(self, frame: int) -> ClipFrame:
        """The picture at a frame of the scene; main thread only.

        Raises:
            ShotError: It cannot be read.
            CameraError: The camera has another shape, or is none that could have seen it.
        """
        scene = bpy.data.scenes[self.scene]
        pixels = self._strip_pixels(frame) if self.edit else _clip_pixels(self.name, frame)
        size = pixels.shape[1], pixels.shape[0]
        check_shape(scene.render, size)
        with stand_in_for(scene) as stand_in:
            stand_in.frame_set(frame)
            camera = read_camera(stand_in.view_layers[0].depsgraph, size)
        return ClipFrame(frame, pixels, camera, self._boxes(scene, frame, size))

    def _strip_pixels(self, frame: int) -> np.ndarray:
        edit = bpy.data.scenes[self.edit]
        return StripFrame(edit, edit.sequence_editor.strips_all[self.name], frame).pixels()

    def _boxes(
        self, scene: bpy.types.Scene, frame: int, size: tuple[int, int]
    ) -> dict[str, Box] | None:
        if self.tracked is None:
            return None
        framing, boxes = scene.playable_environment.framing, {}
        for name in self.tracked:
            try:
                boxes[name] = tracked_box(framing.clip, framing.tracked[name].tracks, frame, size)
            except ShotError:
                # Not tracked here: its neighbours tell, or it is said how seldom it is seen.
                continue
        return boxes


def covering_strip(
    edits: Iterable[bpy.types.Scene], frames: Sequence[int]
) -> tuple[bpy.types.Scene, bpy.types.ID]:
    """The active, or else the topmost, movie or image strip that shows at all frames.

    Raises:
        ShotError: None does.
    """
    looked = []
    for scene in edits:
        if scene.sequence_editor is None:
            continue
        looked.append(repr(scene.name))
        active = scene.sequence_editor.active_strip
        strips = sorted(scene.sequence_editor.strips_all, key=lambda each: -each.channel)
        strips.sort(key=lambda each: each != active)
        for strip in strips:
            start, length = span(strip) if strip.type in PICTURED else (0, 0)
            if not strip.mute and start <= frames[0] and frames[-1] < start + length:
                return scene, strip
    raise ShotError(
        f"no movie or image strip shows from frame {frames[0]} to {frames[-1]} in "
        f"{' or '.join(dict.fromkeys(looked)) or 'any sequencer'}; change the scene's range, or "
        "choose a movie clip"
    )


def tracked_names(scene: bpy.types.Scene, names: Iterable[str]) -> tuple[str, ...] | None:
    """The objects that have tracks; None where no track is named for any.

    Raises:
        ShotError: Some have tracks and some have none.
    """
    framing, wanted = scene.playable_environment.framing, list(names)
    named = {each.name for each in framing.tracked if each.tracks}
    lacking = [name for name in wanted if name not in named]
    if framing.clip is None or len(lacking) == len(wanted):
        return None
    if lacking:
        raise ShotError(f"{lacking[0]!r} has no tracks; name them under Objects in Environment")
    return tuple(wanted)


def _clip_pixels(name: str, frame: int) -> np.ndarray:
    clip = bpy.data.movieclips[name]
    path = Path(bpy.path.abspath(clip.filepath)).resolve()
    index = frame - clip.frame_start + clip.frame_offset
    if not 0 <= index < clip.frame_duration:
        raise ShotError(
            f"the clip {name!r} has {clip.frame_duration} frames and starts at frame "
            f"{clip.frame_start}; it does not show at frame {frame}: change the scene's range"
        )
    if clip.source == "SEQUENCE":
        return read_picture(str(_numbered(path, index)))
    stage = bpy.data.scenes.new("Playable Environment clip")
    try:
        strips = stage.sequence_editor_create().strips
        strip = strips.new_movie(name, str(path), channel=1, frame_start=frame - index)
        return StripFrame(stage, strip, frame).pixels()
    finally:
        bpy.data.scenes.remove(stage)


def _numbered(first: Path, index: int) -> Path:
    """The file of a sequence that lies some frames after the first one."""
    found = re.fullmatch(r"(.*?)(\d+)(\D*)", first.name)
    if found is None:
        return first
    before, digits, after = found.groups()
    return first.with_name(f"{before}{int(digits) + index:0{len(digits)}d}{after}")
