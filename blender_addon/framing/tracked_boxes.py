"""Boxes from the tracking markers of a movie clip."""

from collections.abc import Iterable

import bpy
import numpy as np

from pe_runtime.contract.errors import ShotError

from .box_limits import Box


def tracked_box(
    clip: bpy.types.MovieClip, tracks: str, frame: int, picture_size: tuple[int, int]
) -> Box:
    """The box around tracking markers at a frame.

    Args:
        clip: With the markers.
        tracks: The name of a plane track (its corners count), of one track (its pattern counts),
            or how the names of several tracks begin (their markers count).
        frame: Scene frame.
        picture_size: Width and height of the picture; the clip is scaled to fill it.

    Returns:
        Left, top, right, bottom in pixels, from the picture's upper left corner.

    Raises:
        ShotError: Nothing is called so, or it is not tracked at this frame.
    """
    tracking = clip.tracking
    local = frame - clip.frame_start + 1
    planes = [each for each in tracking.plane_tracks if each.name == tracks]
    named = [each for each in tracking.tracks if each.name == tracks]
    starting = [each for each in tracking.tracks if tracks and each.name.startswith(tracks)]
    if planes:
        corners = _plane_corners(planes[0], local)
    elif named:
        corners = _pattern_corners(named[0], local)
    else:
        corners = _marker_places(starting, local)
    if len(corners) == 0:
        found = bool(planes or named or starting)
        known = ", ".join([each.name for each in (*tracking.plane_tracks, *tracking.tracks)])
        raise ShotError(
            f"{tracks!r} is not tracked at frame {frame} of clip {clip.name!r}"
            if found
            else f"clip {clip.name!r} has no track {tracks!r}; it has {known or 'none'}"
        )
    if len(corners) < 2:
        raise ShotError(
            f"only one track begins with {tracks!r} and is tracked at frame {frame}; a box needs "
            "two or more, or the full name of one track, whose pattern then counts"
        )
    shares = np.array(corners)
    # Blender counts a clip's shares from its lower left corner.
    (left, low), (right, high) = shares.min(axis=0), shares.max(axis=0)
    width, height = picture_size
    edges = left * width, (1 - high) * height, right * width, (1 - low) * height
    return tuple(float(each) for each in edges)


def _plane_corners(plane: bpy.types.MovieTrackingPlaneTrack, frame: int) -> list[tuple]:
    marker = plane.markers.find_frame(frame, exact=False)
    return [] if marker is None or marker.mute else [tuple(each) for each in marker.corners]


def _pattern_corners(track: bpy.types.MovieTrackingTrack, frame: int) -> list[np.ndarray]:
    marker = _seen(track, frame)
    if marker is None:
        return []
    return [np.array(marker.co) + np.array(corner) for corner in marker.pattern_corners]


def _marker_places(tracks: Iterable[bpy.types.MovieTrackingTrack], frame: int) -> list[tuple]:
    seen = (_seen(each, frame) for each in tracks)
    return [tuple(marker.co) for marker in seen if marker is not None]


def _seen(track: bpy.types.MovieTrackingTrack, frame: int) -> bpy.types.MovieTrackingMarker | None:
    """A track's marker at a frame of the clip; None where it is disabled or not tracked there."""
    marker = track.markers.find_frame(frame, exact=True)
    return None if marker is None or marker.mute else marker
