"""Small seeded environments of any size, density, flatness and place, for stress cases to draw."""

import math
from dataclasses import dataclass, replace

import numpy as np
import torch

from pe_runtime.benchmark.stress_cases import Trial
from pe_runtime.config import (
    BendingConfig,
    EncoderConfig,
    FeatureRendererConfig,
    FieldConfig,
    ModelConfig,
    ObjectClassConfig,
    ObjectConfig,
)
from pe_runtime.contract.camera import Camera
from pe_runtime.environment import PlayableEnvironment
from pe_runtime.networks import SynthesisNetworks
from pe_runtime.state import EnvironmentState, ObjectState

WIDTH, HEIGHT = 8, 8
MIDDLE = (3.0, 3.0)
"""Principal point: here passes a ray of the finest map, exactly along the camera's axis."""
OCTAVES = 5
VIEWS = (
    "from outside",
    "inside a player",
    "in a face",
    "along an edge",
    "on the ground",
    "straight down",
    "away from everything",
)
USUAL = {
    "scale": 1.0,
    "away": 0.0,
    "density": 1.0,
    "samples": 6.0,
    "focal": 8.0,
    "distance": 1.0,
    "thickness": 1.0,
    "view": 0.0,
}
"""What a case's ranges leave out."""
LOW, HIGH = (-0.5, -0.625, 0.0), (0.625, 0.5, 1.75)
"""Volume of a player, in numbers that every precision has."""
PLACES = {"player_1": (-0.25, 0.125, 0.0), "player_2": (0.25, 0.43, 0.0), "wall": (0.0, 4.0, 0.0)}


@dataclass(frozen=True)
class StressScene:
    """What is drawn, and from where."""

    environment: PlayableEnvironment
    state: EnvironmentState
    camera: Camera


def stress_scene(trial: Trial, quadrature: str) -> StressScene:
    """A ground, a wall, a sky and two overlapping players, with random weights.

    Args:
        trial: Numbers by the names of `USUAL`; what is missing is as usual.
        quadrature: "interval", or "release-2022", in which nothing is opaque but the sky.
    """
    values = {**USUAL, **trial.values}
    config = _config(values, quadrature)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(trial.seed)
        networks = SynthesisNetworks(config)
        with torch.no_grad():
            for parameter in networks.parameters():
                parameter += 0.1 * torch.randn_like(parameter)
            if quadrature == "release-2022":
                _keep_off_the_kink(networks)
        offset = values["away"] * values["scale"] * torch.randn(3)
        state = _state(config, values["scale"], offset)
    environment = PlayableEnvironment(config, networks, {}, {"kind": "model"})
    return StressScene(environment, state, _camera(values, offset.double().numpy()))


def _keep_off_the_kink(networks: SynthesisNetworks) -> None:
    """Raw densities are well above 0, where a ReLU makes any rounding a share of nothing."""
    for field in networks.fields.values():
        if field.density is not None:
            field.density.weight.mul_(0.2)
            field.density.bias.fill_(1.0)


def _config(values: dict[str, float], quadrature: str) -> ModelConfig:
    scale = values["scale"]
    return ModelConfig(
        name="stress",
        width=WIDTH,
        height=HEIGHT,
        near=0.05 * scale,
        quadrature=quadrature,
        carve_overlaps=quadrature == "release-2022",
        classes=_classes(values, quadrature == "release-2022"),
        objects=(
            ObjectConfig("ground", "ground"),
            ObjectConfig("wall", "wall", _scaled(PLACES["wall"], scale)),
            ObjectConfig("sky", "sky"),
            ObjectConfig("player_1", "player"),
            ObjectConfig("player_2", "player"),
        ),
        feature_renderer=FeatureRendererConfig(
            strides=(2, 4), features=(4, 4), widths=(4, 4), output_widths=(4,)
        ),
    )


def _classes(values: dict[str, float], released: bool) -> dict[str, ObjectClassConfig]:
    scale = values["scale"]
    field = FieldConfig(
        width=12,
        depth=3,
        skip=2,
        octaves=OCTAVES,
        head_width=8,
        density="relu" if released else "softplus",
        density_scale=values["density"] / scale * (1.0 if released else 10.0),
    )
    ground = ObjectClassConfig(
        low=_scaled((-5.0, -5.0, -0.02 * values["thickness"]), scale),
        high=_scaled((5.0, 4.0, 0.0), scale),
        axes=(0, 1),
        samples=int(values["samples"]),
        opaque=not released,
        style_features=3,
        depth_range=(0.25 * scale, 200 * scale * values["distance"]) if released else None,
        field=field,
        encoder=EncoderConfig(crop="frame", height=8, width=8, channels=(4,), hidden=4),
    )
    wall = replace(
        ground,
        low=_scaled((-5.0, 0.0, 0.0), scale),
        high=_scaled((5.0, 0.0625 * values["thickness"], 2.0), scale),
        axes=(0, 2),
    )
    behind = 90 * scale * values["distance"]
    sky = replace(
        ground,
        kind="sky",
        axes=(0, 1, 2),
        depth_range=(behind, behind + scale) if released else None,
    )
    half = values["thickness"] * (HIGH[1] - LOW[1]) / 2
    player = replace(
        ground,
        kind="playable",
        low=_scaled((LOW[0], -half, LOW[2]), scale),
        high=_scaled((HIGH[0], half, HIGH[2]), scale),
        axes=(0, 1, 2),
        opaque=False,
        pose_features=2,
        bending=BendingConfig(width=8, depth=2, octaves=2, output_scale=0.1),
    )
    return {"ground": ground, "wall": wall, "sky": sky, "player": player}


def _scaled(numbers: tuple[float, float, float], scale: float) -> tuple[float, float, float]:
    first, second, third = (each * scale for each in numbers)
    return first, second, third


def _state(config: ModelConfig, scale: float, offset: torch.Tensor) -> EnvironmentState:
    objects = {}
    for each in config.objects:
        kind = config.classes[each.class_name]
        place = torch.tensor(PLACES.get(each.name, (0.0, 0.0, 0.0)), dtype=torch.float64)
        objects[each.name] = ObjectState(
            (place * scale + offset.double()).float(),
            torch.randn(kind.style_features),
            torch.randn(kind.pose_features),
            heading=0.3 if each.name == "player_2" else 0.0,
        )
    return EnvironmentState(objects)


def _camera(values: dict[str, float], offset: np.ndarray) -> Camera:
    """A camera at the trial's view, in exact numbers where rays are to lie in faces."""
    view, scale = VIEWS[int(values["view"])], values["scale"]
    first = np.array(PLACES["player_1"])
    corner = first + np.array([HIGH[0], -4.0, HIGH[2]])
    places = {
        "from outside": np.array([0.3, -4.0, 1.5]),
        "inside a player": first + np.array([0.1, 0.1, 1.0]),
        "in a face": np.array([corner[0], -4.0, 1.0]),
        "along an edge": corner,
        "on the ground": np.array([0.0, -4.0, 0.0]),
        "straight down": np.array([-0.25, 0.125, 5.0]),
        "away from everything": np.array([0.0, 6.0, 1.0]),
    }
    tilt = {"from outside": 0.2, "inside a player": 0.1, "straight down": math.pi / 2}
    cosine, sine = math.cos(tilt.get(view, 0.0)), math.sin(tilt.get(view, 0.0))
    pose = np.eye(4)
    pose[:3, :3] = [[1.0, 0.0, 0.0], [0.0, -sine, cosine], [0.0, -cosine, -sine]]
    # From afar the same part of the scene is seen through a longer lens.
    steps_back = 4.0 * (values["distance"] - 1.0) * pose[:3, 2]
    pose[:3, 3] = (places[view] - steps_back) * scale + offset
    focal = values["focal"] * values["distance"]
    intrinsics = np.array([[focal, 0.0, MIDDLE[0]], [0.0, focal, MIDDLE[1]], [0.0, 0.0, 1.0]])
    return Camera(WIDTH, HEIGHT, intrinsics, pose)
