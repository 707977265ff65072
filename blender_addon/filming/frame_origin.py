"""Where a frame comes from, in words that its file carries wherever it goes. No `bpy` here."""

import json
from pathlib import PurePath

from pe_runtime.contract.model_facts import ModelFacts
from pe_runtime.contract.shot import Shot

from ..state_files import is_content_name

PREFIX = "playable."
"""Before the names of the fields, so that nobody else's are meant."""


def frame_origin(take: Shot, whole: Shot, facts: ModelFacts) -> dict[str, str]:
    """What a picture file says of its frame; the same in every run that draws the frame.

    Args:
        take: The shot of that frame alone.
        whole: The shot that it is a take of.
        facts: The model that draws it.

    Returns:
        By field name the model and the SHA-256 of its weights, that of the encoded picture, the
        quality, and as JSON the action of every playable object and the camera.
    """
    frame = take.frame_start
    actions = {track.name: whole.action_at(track.name, frame) for track in take.objects}
    fields = {
        "model": f"{facts.name} {facts.digest}".strip(),
        "state": state_digest(whole),
        "quality": take.quality,
        "actions": json.dumps({name: each for name, each in actions.items() if each is not None}),
        "camera": json.dumps(take.cameras[0].as_dict()),
    }
    return {PREFIX + name: value for name, value in fields.items()}


def state_digest(shot: Shot) -> str:
    """SHA-256 of the encoded picture that a shot starts from, hex; empty where it has none yet."""
    path = shot.start.state
    return PurePath(path).stem if path is not None and is_content_name(path) else ""
