"""From which frame on two shots lead to other paths. No `bpy` here."""

import numpy as np

from pe_runtime.contract.camera import Camera
from pe_runtime.contract.shot import ObjectTrack, Shot

from ..state_files import portable

TOLERANCE = 1e-6


def first_difference(before: Shot, now: Shot) -> int | None:
    """The first frame at which a shot asks for something else than an earlier one did.

    Args:
        before: The earlier shot.
        now: The shot; what it asks of pictures, such as passes, does not count.

    Returns:
        None where both ask for the same paths; the first frame of `now` where they do from there.
    """
    then, here = portable(before), portable(now)
    names = [track.name for track in then.objects]
    kept = then.model, then.start.as_dict(), then.fps, then.frame_start, names
    asked = here.model, here.start.as_dict(), here.fps, here.frame_start
    if kept != (*asked, [track.name for track in here.objects]):
        return here.frame_start
    for frame in range(here.frame_start, min(then.frame_end, here.frame_end) + 1):
        if not _same_frame(then, here, frame):
            return frame
    shorter = min(then.frame_end, here.frame_end) + 1
    return None if then.frame_end == here.frame_end else shorter


def _same_frame(then: Shot, here: Shot, frame: int) -> bool:
    if not _same_camera(then.camera_at(frame), here.camera_at(frame)):
        return False
    index = frame - here.frame_start
    return all(
        old.action_at(frame) == new.action_at(frame) and _seen(old, index) == _seen(new, index)
        for old, new in zip(then.objects, here.objects, strict=True)
    )


def _same_camera(then: Camera, here: Camera) -> bool:
    if (then.width, then.height) != (here.width, here.height):
        return False
    far = np.abs(then.world_from_camera - here.world_from_camera).max()
    wide = np.abs(then.intrinsics - here.intrinsics).max()
    return far <= TOLERANCE and wide <= TOLERANCE * max(here.width, 1)


def _seen(track: ObjectTrack, index: int) -> bool:
    return track.visible is None or track.visible[index]
