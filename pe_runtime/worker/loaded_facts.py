"""What a trained environment has to say of itself to Blender."""

import math
from collections.abc import Mapping
from typing import Any

import torch

from pe_runtime.config import ModelConfig
from pe_runtime.contract.envelope import ENVELOPE_KEY, Envelope
from pe_runtime.contract.errors import CheckpointError
from pe_runtime.contract.model_facts import ModelFacts, Movement, Volume
from pe_runtime.environment import PlayableEnvironment
from pe_runtime.evaluation.rules import OWN_DETECTOR
from pe_runtime.worker.usual_cameras import usual_camera

RESTS = ("idle", "stay")
"""Names of actions that are rest, as recorders and descriptions give them."""


def facts_of(environment: PlayableEnvironment, digest: str = "") -> ModelFacts:
    """All that Blender must know of a loaded model.

    Args:
        environment: The model.
        digest: What `shots.frames.model_digest` says of it.

    Raises:
        CheckpointError: The file's header says something that makes no sense.
    """
    config = environment.config
    names = {name: _action_names(environment, name) for name in environment.playable_names}
    licence = (environment.header.get("imported") or {}).get("licence", "")
    return ModelFacts(
        name=config.name,
        action_names=names,
        steps_per_second=environment.steps_per_second,
        width=config.width,
        height=config.height,
        resting_actions={n: _resting(environment, n, each) for n, each in names.items() if each},
        turning_names=turning_names(environment),
        volumes=_volumes(config),
        usual_camera=usual_camera(config),
        licence=str(licence),
        movements={name: _movements(environment, name, each) for name, each in names.items()},
        envelope=envelope_in(environment.header),
        detects=OWN_DETECTOR.is_file(),
        device=device_words(environment.device),
        digest=digest,
    )


def envelope_in(header: Mapping[str, Any]) -> Envelope | None:
    """What a model's header says of its training data; None if it says nothing.

    Raises:
        CheckpointError: What it says is no envelope.
    """
    content = header.get(ENVELOPE_KEY)
    try:
        return None if content is None else Envelope.from_dict(content)
    except (KeyError, TypeError, ValueError) as error:
        raise CheckpointError(
            f"the model's header says {content!r:.200} of its training data ({error!r}); expected "
            "the ranges that training writes there"
        ) from error


def device_words(device: torch.device) -> str:
    """A device and, where it has one, its maker's name."""
    if device.type != "cuda":
        return device.type
    return f"cuda: {torch.cuda.get_device_name(device)}"


def turning_names(environment: PlayableEnvironment) -> tuple[str, ...]:
    """Playable objects whose heading an encoder sees or the dynamics network predicts."""
    config = environment.config
    return tuple(
        name
        for name in environment.playable_names
        if config.class_of(name).heading is not None
        or (config.action.predict_heading and _class_name(config, name) in environment.actions)
    )


def _class_name(config: ModelConfig, name: str) -> str:
    return next(each.class_name for each in config.objects if each.name == name)


def _action_names(environment: PlayableEnvironment, name: str) -> tuple[str, ...]:
    """Names of an object's actions; none without a trained module, numbers if it names none."""
    if _class_name(environment.config, name) not in environment.actions:
        return ()
    count = environment.config.action.actions
    return environment.action_names[name] or tuple(f"action_{k + 1}" for k in range(count))


def _resting(environment: PlayableEnvironment, name: str, actions: tuple[str, ...]) -> int:
    """The action of an object that nobody plays: rest by name, else what moved it least."""
    for word in RESTS:
        if word in actions:
            return actions.index(word)
    speeds = [math.hypot(*each) for each in _movements(environment, name, actions)]
    return speeds.index(min(speeds)) if speeds else 0


def _movements(
    environment: PlayableEnvironment, name: str, actions: tuple[str, ...]
) -> tuple[Movement, ...]:
    """How each action moved an object in training; empty where nobody has written it down.

    Where actions are relative to the object or the world, as a camera sees it that looks along y.
    """
    described = environment.header.get("actions", {}).get(_class_name(environment.config, name), [])
    if not actions or len(described) != len(actions):
        return ()
    found = (each.get("movement", (0.0, 0.0)) for each in described)
    return tuple((float(right), float(ahead)) for right, ahead in found)


def _volumes(config: ModelConfig) -> dict[str, Volume]:
    classes = {each.name: config.classes[each.class_name] for each in config.objects}
    return {n: Volume(each.low, each.high) for n, each in classes.items() if each.kind != "sky"}
