"""Variations on a scene: more or fewer pixels, samples and players."""

from collections.abc import Sequence
from dataclasses import replace

import torch

from pe_runtime.benchmark.scenes import Scene, ground_places
from pe_runtime.config import ModelConfig, ObjectConfig
from pe_runtime.contract.errors import ConfigError
from pe_runtime.environment import PlayableEnvironment
from pe_runtime.networks import SynthesisNetworks
from pe_runtime.state import EnvironmentState, change, hide

BEHIND = 20.0
"""Metres behind the camera at which objects are out of view."""
CASTS = ("as found", "hidden", "absent", "in view", "out of view", "more hidden")
"""Who is there besides the static scene: the players, nobody visible, nobody at all, or the
players and more of their kind."""


def resized(scene: Scene, width: int, height: int) -> Scene:
    """The same view on another pixel grid."""
    return replace(scene, camera=scene.camera.scaled(width, height))


def with_samples(scene: Scene, factor: float) -> Scene:
    """Every class sampled so many times as finely."""
    config = scene.environment.config
    classes = {
        name: replace(each, samples=max(1, round(factor * each.samples)))
        for name, each in config.classes.items()
    }
    return _rebuilt(scene, replace(config, classes=classes), scene.state)


def with_cast(scene: Scene, cast: str, count: int) -> Scene:
    """Other company for the static scene.

    Args:
        scene: A scene with players.
        cast: One of `CASTS`.
        count: How many more players there are.

    Raises:
        ConfigError: There is no such cast, or the scene has no players to multiply.
    """
    config, state = scene.environment.config, scene.state
    players = scene.environment.playable_names
    if cast not in CASTS or (count and not players):
        raise ConfigError(f"no cast {cast!r} of {count} in this scene; known: {', '.join(CASTS)}")
    if cast == "absent":
        objects = tuple(o for o in config.objects if o.name not in players)
        rest = EnvironmentState({o.name: state[o.name] for o in objects})
        return _rebuilt(scene, replace(config, objects=objects), rest)
    if cast == "hidden":
        for name in players:
            state = hide(state, name)
        return replace(scene, state=state)
    classes = {o.name: o.class_name for o in config.objects}
    more = {f"extra_{i + 1}": players[i % len(players)] for i in range(count)}
    places = _extra_places(scene, cast, count)
    added = dict(state.objects)
    for (name, model), place in zip(more.items(), places, strict=True):
        twin = change(state, model, position=place, visible=cast != "more hidden")
        added[name] = twin[model]
    objects = tuple(ObjectConfig(name, classes[model]) for name, model in more.items())
    wider = replace(config, objects=config.objects + objects)
    return _rebuilt(scene, wider, EnvironmentState(added))


def _rebuilt(scene: Scene, config: ModelConfig, state: EnvironmentState) -> Scene:
    """The same weights under another configuration."""
    before = scene.environment
    networks = SynthesisNetworks(config).to(before.device)
    networks.load_state_dict(before.networks.state_dict())
    for name in ("encoders", "headings", "feature_renderer"):
        # Nothing in them changes; ten copies of large encoders would fill the memory.
        setattr(networks, name, getattr(before.networks, name))
    environment = PlayableEnvironment(config, networks, before.actions, before.header)
    return Scene(environment, state, scene.camera)


def _extra_places(scene: Scene, cast: str, count: int) -> Sequence[torch.Tensor]:
    pose = scene.camera.world_from_camera
    if cast == "out of view":
        behind = torch.from_numpy(pose[:3, 3] - BEHIND * pose[:3, 2]).float()
        return [behind + torch.tensor([2.0 * number, 0.0, 0.0]) for number in range(count)]
    return ground_places(scene.camera, count, (0.75, 0.8), (0.25, 0.4))
