"""What the worker is asked beside paths and frames: cameras, boxes, actions, digests. No `bpy`."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pe_runtime.contract.camera import Camera
from pe_runtime.contract.messages import Message
from pe_runtime.contract.shot import Shot

from .replies import (
    DetectedBoxes,
    MatchedCamera,
    actions_from,
    detected_from,
    digests_from,
    matched_from,
)
from .session import Session
from .worker_client import OnProgress, ShouldStop


def match_camera(
    session: Session,
    model: str,
    size: tuple[int, int],
    points: Sequence[Sequence[float]],
    focal: float | None = None,
    should_stop: ShouldStop | None = None,
) -> MatchedCamera:
    """Solve a camera from points of the ground.

    Args:
        session: Whose worker answers.
        model: Loaded first, as for every question.
        size: Width and height of the picture, pixels.
        points: Four or more of (u, v, x, y): a pixel and environment metres on the ground.
        focal: Pixels; None to solve for it.
        should_stop: Asked while waiting.
    """
    listed = [[float(number) for number in point] for point in points]
    fields = {"width": size[0], "height": size[1], "points": listed, "focal": focal}
    return matched_from(session.ask(model, Message("match_camera", fields), should_stop))


def detect(
    session: Session,
    model: str,
    image: np.ndarray,
    names: Sequence[str],
    should_stop: ShouldStop | None = None,
) -> DetectedBoxes:
    """Find playable objects in a picture, (height, width, 3) uint8 sRGB.

    Raises:
        WorkerError: The runtime has no detector.
    """
    request = Message("detect", {"names": list(names)}, {"image": image})
    return detected_from(session.ask(model, request, should_stop))


def infer_actions(
    session: Session,
    model: str,
    states: Sequence[Mapping[str, Any]],
    cameras: Sequence[Camera],
    should_stop: ShouldStop | None = None,
    on_progress: OnProgress | None = None,
) -> dict[str, list[int]]:
    """The actions that lead from each state to the next one, by playable object.

    Args:
        session: Whose worker answers.
        model: Whose states they are.
        states: As `Session.encode` gives them, one model step apart.
        cameras: One for each state.
        should_stop: Asked while waiting.
        on_progress: Told how far it is.
    """
    fields = {"states": list(states), "cameras": [each.as_dict() for each in cameras]}
    request = Message("infer_actions", fields)
    return actions_from(session.ask(model, request, should_stop, on_progress))


def digests(
    session: Session,
    shot: Shot,
    whole: Shot | None = None,
    should_stop: ShouldStop | None = None,
    yielding: bool = False,
) -> dict[int, str]:
    """By frame a digest over everything that decides its pixels, weights too.

    Args:
        session: Whose worker answers.
        shot: The frames that are meant.
        whole: The shot that this is a take of, as for `Session.render`.
        should_stop: Asked while waiting.
        yielding: Make way for others.
    """
    with session.conversation(shot.model, should_stop, yielding) as (client, stop):
        if whole is not None:
            client.prepare(whole, stop)
        request = Message("digests", {"shot": shot.as_dict(), "take": whole is not None})
        return digests_from(client.ask(request, stop))
