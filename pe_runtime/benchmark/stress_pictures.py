"""Stress of whole pictures: fields, composition and ConvNet together, and their gradients.

The truth is the benchmark's renderer in float64, which shares no code with the fast one.
"""

import copy
from dataclasses import replace
from functools import partial

import torch
from torch import Tensor

from pe_runtime.benchmark.reference import reference_picture
from pe_runtime.benchmark.stress_cases import (
    Case,
    Measured,
    Outcome,
    Spread,
    Trial,
    compare,
    finite,
    gradients,
    one_of,
    worst,
)
from pe_runtime.benchmark.stress_scene import VIEWS, StressScene, stress_scene
from pe_runtime.environment import PlayableEnvironment
from pe_runtime.geometry.cameras import Cameras
from pe_runtime.rendering.scene import RenderSettings

BOUNDS = {"float32": 1e-5, "bfloat16": 8 * 2.0**-7}
"""Of pictures: what "exact" promises, and 8 eps of bfloat16."""
SLOPES = {"float32": 1e-3, "bfloat16": 32 * 2.0**-7}
"""Of gradients, as a share of their sizes; where a rounding switches a ReLU, a sample's is lost."""
STEPS = (1e-7, 1e-8)
"""Shares of parameters by which a true picture is changed to see its slope. The better one counts:
now and then a ReLU switches within the step."""


def draw_picture(quadrature: str, trial: Trial) -> Outcome:
    """One frame with depth and masks, and the gradients that training would take from it."""
    scene = stress_scene(trial, quadrature)
    environment, state = scene.environment, scene.state
    settings = RenderSettings(
        near=environment.config.near, bfloat16=trial.precision == "bfloat16", remember=True
    )
    cameras, codes = Cameras.stack([scene.camera]), environment.codes(state)
    picture, _ = environment.renderer.draw(cameras, codes, settings)
    truth = torch.from_numpy(reference_picture(environment, state, scene.camera))
    seen = environment.renderer.geometry(cameras, codes, settings)
    shares = torch.stack(list(seen.masks.values()))
    forward = [
        compare(picture.permute(1, 2, 0), truth, 1.0, BOUNDS[trial.precision]),
        compare(shares, shares.double().clamp(0.0, 1.0), 1.0, BOUNDS[trial.precision]),
        finite(torch.where(seen.depth == torch.inf, 0.0, seen.depth)),
    ]
    total, inputs = _trained(trial, scene)
    return Outcome(worst(forward), finite(*gradients(total, inputs)))


def approximate_picture(quadrature: str, trial: Trial) -> Outcome:
    """A frame with everything left out that a quality may leave out."""
    scene = stress_scene(trial, quadrature)
    environment = scene.environment
    settings = RenderSettings(
        near=environment.config.near,
        weight_threshold=1e-3,
        sample_share=0.5,
        occupancy=True,
        termination=1e-2,
        bfloat16=trial.precision == "bfloat16",
        remember=True,
    )
    cameras, codes = Cameras.stack([scene.camera]), environment.codes(scene.state)
    picture, _ = environment.renderer.draw(cameras, codes, settings)
    seen = environment.renderer.geometry(cameras, codes, settings)
    shares = torch.stack(list(seen.masks.values()))
    return Outcome(
        worst(
            [
                compare(shares, shares.double().clamp(0.0, 1.0), 1.0, BOUNDS[trial.precision]),
                finite(picture, torch.where(seen.depth == torch.inf, 0.0, seen.depth)),
            ]
        )
    )


def train_picture(quadrature: str, trial: Trial) -> Outcome:
    """A picture as training draws it, and its slope towards the gradients that training takes."""
    scene = stress_scene(trial, quadrature)
    total, inputs = _trained(trial, scene)
    parameters = list(scene.environment.networks.parameters())
    slopes = gradients(total, inputs)[: len(parameters)]
    signs = torch.rand(len(slopes), generator=trial.generator()).sub(0.5).sign().tolist()
    # Each parameter is moved along its own gradient, so that each one's counts.
    sizes = [float(p.detach().norm()) for p in parameters]
    ways = [
        sign * size * slope.double() / slope.double().norm().clamp(min=1e-30)
        for sign, size, slope in zip(signs, sizes, slopes, strict=True)
    ]
    expected = sum(float((s.double() * w).sum()) for s, w in zip(slopes, ways, strict=True))
    reach = sum(float(s.double().norm()) * n for s, n in zip(slopes, sizes, strict=True))
    errors = [abs(expected - _true_slope(trial, scene, ways, step)) / reach for step in STEPS]
    truth = torch.tensor(_true_total(trial, scene, ways, 0.0), dtype=torch.float64)
    size = float(_towards(trial, scene).abs().sum())
    backward = Measured(min(errors), SLOPES[trial.precision], finite(*slopes).nonfinite)
    return Outcome(compare(total, truth, size, BOUNDS[trial.precision]), backward)


def train_noisily(quadrature: str, trial: Trial) -> Outcome:
    """A picture with everything that training draws at random: places of samples, and densities."""
    scene = stress_scene(trial, quadrature)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(trial.seed)
        total, inputs = _trained(trial, scene, trial["noise"])
    return Outcome(finite(total), finite(*gradients(total, inputs)))


def _trained(
    trial: Trial, scene: StressScene, noise: float | None = None
) -> tuple[Tensor, list[Tensor]]:
    """A weighted sum of the picture that training would draw, and what it depends on.

    Args:
        trial: Where the weights of the sum come from.
        scene: What is drawn.
        noise: Deviation of raw densities, with places drawn at random; None for neither.

    Returns:
        The sum, and all parameters followed by all codes that an encoder could have found.
    """
    environment, camera = scene.environment, scene.camera
    cameras, codes = Cameras.stack([camera]), environment.codes(scene.state)
    settings = RenderSettings(
        near=environment.config.near, jitter=noise is not None, density_noise=noise or 0.0
    )
    size, windows = (camera.height, camera.width), torch.zeros(1, 2, dtype=torch.long)
    codes = {
        name: replace(
            each,
            position=each.position.clone().requires_grad_(),
            style=each.style.clone().requires_grad_(),
            pose=each.pose.clone().requires_grad_(),
            heading=None if each.heading is None else each.heading.clone().requires_grad_(),
        )
        for name, each in codes.items()
    }
    with trial.mixed():
        drawn = environment.networks.synthesise(cameras, codes, windows, size, settings)
    picture = drawn[0].permute(1, 2, 0)
    found = [
        code
        for each in codes.values()
        for code in (each.position, each.style, each.pose, each.heading)
        if code is not None
    ]
    inputs = [*environment.networks.parameters(), *found]
    return (picture * _towards(trial, scene)).sum(), inputs


def _towards(trial: Trial, scene: StressScene) -> Tensor:
    shape = (scene.camera.height, scene.camera.width, 3)
    return torch.rand(shape, generator=trial.generator()) - 0.5


def _true_slope(trial: Trial, scene: StressScene, ways: list[Tensor], step: float) -> float:
    ends = [_true_total(trial, scene, ways, way) for way in (step, -step)]
    return (ends[0] - ends[1]) / (2 * step)


def _true_total(trial: Trial, scene: StressScene, ways: list[Tensor], step: float) -> float:
    """The sum in float64, with every parameter moved by a step along its way."""
    networks = copy.deepcopy(scene.environment.networks).double()
    with torch.no_grad():
        for parameter, way in zip(networks.parameters(), ways, strict=True):
            parameter += step * way
    moved = PlayableEnvironment(scene.environment.config, networks, {}, {"kind": "model"})
    picture = torch.from_numpy(reference_picture(moved, scene.state, scene.camera))
    return float((picture * _towards(trial, scene)).sum())


def _points(**values: tuple[float, ...]) -> tuple[dict[str, float], ...]:
    """Points from columns of numbers."""
    return tuple(dict(zip(values, row, strict=True)) for row in zip(*values.values(), strict=True))


_BOUND = "1e-5, the promise of exact, whatever the scene; in bfloat16 8 eps"
_RANGES = {
    "world scale and distance": {
        "scale": Spread((1e-3, 1e6)),
        "away": Spread((0.0, 1.0, 1e5)),
        "distance": Spread((1.0, 1e5)),
    },
    "densities and samples": {
        "density": Spread((0.0, 1.0, 1e10, 1e30)),
        "samples": Spread((1.0, 1024.0), "whole"),
        "focal": Spread((1.0, 4.0)),
    },
    "views and lenses": {"view": one_of(VIEWS), "focal": Spread((1e-3, 8.0, 1e7))},
    "flat volumes": {"thickness": Spread((1e-9, 1e-6, 1e-3))},
}
_TRIED = {
    "world scale and distance": _points(
        scale=(1e-3, 1e-3, 1.0, 1.0, 1e6, 1e6), away=(0.0, 1e5) * 3, distance=(1.0, 1e5) * 3
    ),
    "densities and samples": _points(
        density=(0.0, 0.0, 1.0, 1.0, 1e10, 1e30),
        samples=(1.0, 64.0, 1.0, 1024.0, 64.0, 2.0),
        focal=(4.0, 4.0, 4.0, 1.0, 4.0, 4.0),
    ),
    "views and lenses": _points(
        view=(*map(float, range(len(VIEWS))), 0.0, 0.0), focal=(8.0,) * len(VIEWS) + (1e-3, 1e7)
    ),
}


def _drawing(quadrature: str) -> list[Case]:
    return [
        Case(
            f"pictures: {name}, {quadrature}",
            ranges,
            partial(draw_picture, quadrature),
            _BOUND,
            draws=0,
            examples=2,
            tried=_TRIED.get(name, ()),
        )
        for name, ranges in _RANGES.items()
    ]


def _training(quadrature: str) -> Case:
    return Case(
        f"gradients of pictures, {quadrature}",
        {"view": one_of(VIEWS), "scale": Spread((1e-3, 1.0, 1e6))},
        partial(train_picture, quadrature),
        "1e-3 of the gradients' sizes against differences of true pictures; in bfloat16 32 eps",
        draws=0,
        examples=2,
        tried=_points(view=(0.0, 1.0, 3.0), scale=(1.0, 1e6, 1e-3)),
    )


def _approximating(quadrature: str) -> Case:
    return Case(
        f"pictures of approximate qualities, {quadrature}",
        {
            "scale": Spread((1e-3, 1.0, 1e6)),
            "density": Spread((0.0, 1.0, 1e30)),
            "view": one_of(VIEWS),
            "distance": Spread((1.0, 1e5)),
        },
        partial(approximate_picture, quadrature),
        "finite, and shares within 0 and 1",
        draws=4,
        examples=4,
    )


def _noisy(quadrature: str) -> Case:
    return Case(
        f"noise of training, {quadrature}",
        {"noise": Spread((0.0, 1.0, 1e3)), "density": Spread((1.0, 1e10)), "view": one_of(VIEWS)},
        partial(train_noisily, quadrature),
        "finite",
        draws=2,
        examples=2,
        tried=_points(noise=(0.0, 1.0, 1e3), density=(1e10, 1.0, 1e10), view=(0.0, 1.0, 2.0)),
    )


PICTURES = tuple(
    case
    for quadrature in ("interval", "release-2022")
    for case in (
        *_drawing(quadrature),
        _approximating(quadrature),
        _training(quadrature),
        _noisy(quadrature),
    )
)
