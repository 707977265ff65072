"""Rendered frames as one image strip of a sequencer, and that strip again when they change.

What the artist has made of the strip stays: its place and channel, its trimming, its effects. By
default it stands in "<scene> Edit" and not in the scene that is rendered: a scene whose sequencer
holds a strip renders the strip, and its engine is never asked again.
"""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import bpy

from pe_runtime.contract.errors import ShotError

from .provenance import JOB_KEY, START_KEY, Provenance, note_provenance
from .timing import Timing, read_timing, span, write_timing

LAST_CHANNEL = 128


@dataclass(frozen=True)
class StripPlan:
    """What a strip should show.

    Attributes:
        job: Names the strip across repetitions and renames.
        name: Shown on the strip when it is new.
        files: One picture per frame, all in one folder.
        frame_start: Timeline frame of the first picture.
        channel: The lowest channel for a new strip, which takes the first free one from there.
        provenance: Where the pictures come from; None to leave that as it is.
    """

    job: str
    name: str
    files: Sequence[Path]
    frame_start: int
    channel: int = 1
    provenance: Provenance | None = None

    @property
    def frame_end(self) -> int:
        """First timeline frame after the strip."""
        return self.frame_start + len(self.files)


def place_strip(target: bpy.types.Scene, plan: StripPlan) -> bpy.types.Strip:
    """Put the frames on a free channel, or into the strips that this job already has.

    Raises:
        ShotError: A file is missing, or the channel is taken.
    """
    missing = [file for file in plan.files if not file.is_file()]
    if missing or not plan.files:
        raise ShotError(
            f"{len(missing)} of {len(plan.files)} rendered frames are missing, first "
            f"{missing[0] if missing else 'none was rendered'}; render the range again"
        )
    if target.sequence_editor is None:
        target.sequence_editor_create()
    placed = strips_of(target, plan.job) or [_new_strip(target, plan)]
    _follow(target, placed[0], plan)
    # A strip that was cut in two, or copied to another scene, is still this job's.
    elsewhere = [s for each in bpy.data.scenes if each != target for s in strips_of(each, plan.job)]
    for strip in (*placed, *elsewhere):
        _fill(strip, plan)
    return placed[0]


def strips_of(scene: bpy.types.Scene, job: str) -> list[bpy.types.Strip]:
    """The strips of a job in a scene, those inside meta strips too."""
    if scene.sequence_editor is None:
        return []
    return [each for each in scene.sequence_editor.strips_all if each.get(JOB_KEY) == job]


def show_new_pixels(folder: Path) -> None:
    """Have every image strip read its files in a folder again, whatever it belongs to."""
    for scene in bpy.data.scenes:
        for strip in scene.sequence_editor.strips_all if scene.sequence_editor else ():
            if strip.type == "IMAGE" and _folder_of(strip) == folder:
                # Blender keeps showing the pixels of replaced files unless it is told.
                strip.invalidate_cache("RAW")


def _new_strip(target: bpy.types.Scene, plan: StripPlan) -> bpy.types.Strip:
    strips, render = target.sequence_editor.strips, target.render
    strip = strips.new_image(
        name=plan.name,
        filepath=str(plan.files[0]),
        channel=_free_channel(strips, plan),
        frame_start=plan.frame_start,
        fit_method="FIT",
    )
    element = strip.elements[0]
    if (element.orig_width, element.orig_height) == (render.resolution_x, render.resolution_y):
        strip.transform.scale_x = strip.transform.scale_y = 1.0
    strip[JOB_KEY], strip[START_KEY] = plan.job, plan.frame_start
    return strip


def _free_channel(strips: Iterable[bpy.types.Strip], plan: StripPlan) -> int:
    start, end, lowest = plan.frame_start, plan.frame_end, plan.channel
    spans = [(each.channel, *span(each)) for each in strips]
    taken = {channel for channel, first, frames in spans if first < end and first + frames > start}
    for channel in range(lowest, LAST_CHANNEL + 1):
        if channel not in taken:
            return channel
    raise ShotError(
        f"all channels from {lowest} to {LAST_CHANNEL} are taken from frame {start} to {end}; "
        "clear one of them"
    )


def _follow(target: bpy.types.Scene, strip: bpy.types.Strip, plan: StripPlan) -> None:
    """Let the scene's range go on ending with the strip, where it did before."""
    first, frames = span(strip)
    if (target.frame_start, target.frame_end) == (first, first + frames - 1):
        shift = plan.frame_start - strip.get(START_KEY, first)
        target.frame_end = max(target.frame_start, first + shift + len(plan.files) - 1)
        target.frame_start = first + shift
        target.frame_end = first + shift + len(plan.files) - 1


def _fill(strip: bpy.types.Strip, plan: StripPlan) -> None:
    _refit(strip, plan)
    folder = plan.files[0].parent
    if _folder_of(strip) != folder or (bpy.data.filepath and not strip.directory.startswith("//")):
        strip.directory = bpy.path.relpath(str(folder)) if bpy.data.filepath else str(folder)
    strip.colorspace_settings.name = "sRGB"
    strip[START_KEY] = plan.frame_start
    if plan.provenance is not None:
        note_provenance(strip, plan.provenance)
    strip.invalidate_cache("RAW")


def _refit(strip: bpy.types.Strip, plan: StripPlan) -> None:
    """Give a strip its pictures, each where it stood before; new ones go to the ends."""
    names = [file.name for file in plan.files]
    before, timing = [each.filename for each in strip.elements], read_timing(strip)
    start = timing.start + plan.frame_start - strip.get(START_KEY, timing.start)
    earlier = _number(before[0]) - _number(names[0])
    later = _number(names[-1]) - _number(before[-1])
    if before != names:
        while len(strip.elements) > 1:
            strip.elements.pop(len(strip.elements) - 1)
        strip.elements[0].filename = names[0]
        for name in names[1:]:
            strip.elements.append(name)
    left = max(0, timing.left + earlier) if timing.left else 0
    right = max(0, timing.right + later) if timing.right else 0
    if left + right >= len(names):
        left = right = 0
    wanted = Timing(start, len(names), left, right)
    if wanted != timing:
        write_timing(strip, wanted)


def _number(name: str) -> int:
    digits = re.search(r"-?\d+(?=\.\w+$)", name)
    return int(digits.group()) if digits else 0


def _folder_of(strip: bpy.types.Strip) -> Path:
    return Path(bpy.path.abspath(strip.directory)).resolve()
