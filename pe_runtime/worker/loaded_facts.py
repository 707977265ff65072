"""What a trained environment has to say of itself to Blender."""

import math

from pe_runtime.config import ModelConfig
from pe_runtime.contract.model_facts import ModelFacts, Volume
from pe_runtime.environment import PlayableEnvironment
from pe_runtime.worker.usual_cameras import usual_camera

RESTS = ("idle", "stay")
"""Names of actions that are rest, as recorders and descriptions give them."""


def facts_of(environment: PlayableEnvironment) -> ModelFacts:
    """All that Blender must know of a loaded model."""
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
    )


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
    described = environment.header.get("actions", {}).get(_class_name(environment.config, name), [])
    speeds = [math.hypot(*each.get("movement", (0.0, 0.0))) for each in described]
    return speeds.index(min(speeds)) if len(speeds) == len(actions) else 0


def _volumes(config: ModelConfig) -> dict[str, Volume]:
    classes = {each.name: config.classes[each.class_name] for each in config.objects}
    return {n: Volume(each.low, each.high) for n, each in classes.items() if each.kind != "sky"}
