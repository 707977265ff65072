"""The float64 renderer against the fast one, a walk along single rays, and itself."""

import copy
import itertools
from dataclasses import replace

import numpy as np
import pytest
import torch
from benchmark.bench_worlds import interval_world, released_world, state_of
from naive_composition import look_along
from small_world import camera, look_at, shake

from pe_runtime.benchmark.reference import reference_features, reference_picture
from pe_runtime.benchmark.reference_decoder import decode
from pe_runtime.benchmark.scenes import seeded_state
from pe_runtime.benchmark.seeded import seeded_tennis
from pe_runtime.config import FeatureRendererConfig
from pe_runtime.environment import PlayableEnvironment
from pe_runtime.geometry.cameras import Cameras, ray_directions
from pe_runtime.rendering.feature_renderer import build_feature_renderer
from pe_runtime.worker.usual_cameras import usual_camera

ALONE = {
    "as they stand": {},
    "turned": {"headings": (0.7, -2.1)},
    "one hidden": {"hidden": ("player_1",)},
    "no sky": {"hidden": ("sky",)},
}
INSIDE = look_at((-0.3, -0.1, 0.8), (0.6, 0.3, 0.7))
"""A camera within a player's volume."""


def furthest(environment, state, view):
    fast = environment.render(state, view).rgb
    return np.abs(fast - reference_picture(environment, state, view)).max(), fast


@pytest.mark.parametrize("asked", ALONE.values(), ids=ALONE)
@pytest.mark.parametrize("view", [camera(), INSIDE], ids=["outside", "inside"])
def test_exact_pictures_of_intervals_are_within_1e_5_of_float64(asked, view):
    environment = interval_world()
    error, picture = furthest(environment, state_of(environment, **asked), view)
    assert error <= 1e-5
    assert picture.std() > 0.05, "a flat picture would agree with anything"


@pytest.mark.parametrize("asked", ALONE.values(), ids=ALONE)
@pytest.mark.parametrize("carve", [False, True], ids=["overlapping", "carved"])
def test_exact_pictures_of_the_authors_quadrature_are_within_1e_5_of_float64(asked, carve):
    environment = released_world(carve)
    error, picture = furthest(environment, state_of(environment, **asked), camera())
    assert error <= 1e-5
    assert picture.std() > 0.03, "a flat picture would agree with anything"


def test_carving_shows_in_the_reference():
    pictures = []
    for carve in (False, True):
        environment = released_world(carve)
        pictures.append(reference_picture(environment, state_of(environment), camera()))
    assert np.abs(pictures[0] - pictures[1]).max() > 1e-3


def test_the_reference_sees_what_a_walk_along_each_ray_sees():
    environment, view = interval_world(), camera()
    state = state_of(environment)
    codes = environment.codes(state)
    slow = [
        replace(each, field=copy.deepcopy(each.field).double())
        for each in environment.networks.scene(codes)
    ]
    pixels = torch.tensor([[16.3, 9.1], [13.0, 8.0], [20.5, 2.5], [4.0, 15.0], [17.9, 7.2]])
    found = reference_features(environment, state, view, pixels.double(), slice(0, 9))
    cameras = Cameras.stack([view])
    directions = ray_directions(cameras, torch.zeros(5, dtype=torch.long), pixels.double())
    for ray, direction in enumerate(directions):
        seen = look_along(cameras.centres[0], direction, 0, slow, environment.config.near)
        # The walk takes box sizes and frequencies from the model's float32 buffers.
        torch.testing.assert_close(found[ray], seen.features, atol=1e-6, rtol=1e-6)


LIGHT = FeatureRendererConfig(
    strides=(1, 2, 4), features=(4, 5, 6), widths=(4, 8, 4), output_widths=(), blocks=2
)
RISING = FeatureRendererConfig(strides=(4,), features=(6,), widths=(8,), output_widths=(8, 4))


@pytest.mark.parametrize(
    "config",
    [
        LIGHT,
        RISING,
        replace(LIGHT, design="paper"),
        replace(LIGHT, design="paper", activated_blocks=True),
        replace(RISING, design="paper"),
    ],
)
def test_the_decoder_of_the_reference_is_the_model_in_float64(config):
    torch.manual_seed(1)
    renderer = build_feature_renderer(config)
    shake(renderer)
    maps = [
        torch.randn(1, channels, 16 // stride, 24 // stride)
        for stride, channels in zip(config.strides, config.features, strict=True)
    ]
    weights = {name: each.double() for name, each in renderer.state_dict().items()}
    with torch.no_grad():
        wanted = renderer.double()([each.double() for each in maps])[0]
        found = decode([each.double() for each in maps], weights, config)
    # The model ends in float32.
    torch.testing.assert_close(found, wanted.double(), atol=3e-7, rtol=0)


def test_more_samples_come_closer_to_the_converged_integral():
    environment, view = interval_world(), camera()
    state = state_of(environment)
    pictures = [reference_picture(environment, state, view, n) for n in (1, 2, 4, 8, 32)]
    apart = [np.abs(each - pictures[-1]).max() for each in pictures[:-1]]
    assert all(a > b for a, b in itertools.pairwise(apart)), apart


def test_a_single_weight_moved_a_little_is_seen():
    environment = interval_world()
    state, view = state_of(environment), camera()
    before = environment.render(state, view).rgb
    networks = copy.deepcopy(environment.networks)
    with torch.no_grad():
        networks.fields["player"].layers[1].weight[3, 2] += 0.5
    moved = PlayableEnvironment(environment.config, networks, {}, {})
    assert np.abs(before - reference_picture(moved, state, view)).max() > 1e-4


def test_seeded_tennis_is_the_same_every_time_and_no_flat_grey():
    environment, again = seeded_tennis(), seeded_tennis()
    for name, each in environment.networks.state_dict().items():
        assert torch.equal(each, again.networks.state_dict()[name]), name
    view = usual_camera(environment.config).scaled(64, 36)
    state = seeded_state(environment.config, view)
    error, picture = furthest(environment, state, view)
    assert 0.07 < picture.std() < 0.4
    assert 0.2 < picture.mean() < 0.8
    assert error <= 1e-5
