"""When a strip plays which of its pictures, by the names of any supported Blender."""

from dataclasses import dataclass

import bpy


@dataclass(frozen=True)
class Timing:
    """Where a strip's pictures lie on the timeline.

    Attributes:
        start: Frame of the first picture, be it trimmed away or not.
        length: How many pictures there are.
        left: How many are trimmed away at the start; negative where the first one is held.
        right: The same at the end.
    """

    start: int
    length: int
    left: int = 0
    right: int = 0


def span(strip: bpy.types.Strip) -> tuple[int, int]:
    """The first timeline frame that a strip covers, and how many it covers."""
    if _has_new_names(strip):
        return round(strip.left_handle), round(strip.duration)
    return strip.frame_final_start, strip.frame_final_duration


def read_timing(strip: bpy.types.Strip) -> Timing:
    """Where a strip's pictures lie."""
    count = len(strip.elements)
    if _has_new_names(strip):
        offsets = strip.left_handle_offset, strip.right_handle_offset
        return Timing(round(strip.content_start), count, *map(round, offsets))
    offsets = strip.frame_offset_start, strip.frame_offset_end
    return Timing(round(strip.frame_start), count, *map(round, offsets))


def write_timing(strip: bpy.types.Strip, timing: Timing) -> None:
    """Lay a strip's pictures where they should be; it has its elements already."""
    left, right = timing.left, timing.right
    if _has_new_names(strip):
        strip.left_handle_offset = strip.right_handle_offset = 0
        strip.content_start, strip.duration = timing.start, timing.length
        strip.left_handle_offset, strip.right_handle_offset = left, right
    else:
        strip.frame_offset_start = strip.frame_offset_end = 0
        strip.frame_start, strip.frame_final_duration = timing.start, timing.length
        strip.frame_offset_start, strip.frame_offset_end = left, right


def _has_new_names(strip: bpy.types.Strip) -> bool:
    # Blender 5.2 renames a strip's handles and warns about the old names.
    return "content_start" in strip.bl_rna.properties
