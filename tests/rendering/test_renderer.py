import copy
import math
from dataclasses import replace

import pytest
import torch
from naive_composition import look_along
from small_world import (
    camera,
    look_at,
    random_codes,
    rays_of,
    small_config,
    small_networks,
)

from pe_runtime.rendering.renderer import compose
from pe_runtime.rendering.scene import Rays, RenderSettings

CHANNELS = 9
SETTINGS = RenderSettings(bucket=8)
VIEWS = [camera(0.2), camera(-0.3, distance=4.0)]
INSIDE = look_at((-0.6, 0.0, 0.8), (0.6, 0.3, 0.7))
"""A camera within the volume of the first player."""


def everything(rays):
    return [(slice(0, len(rays.frame)), slice(0, CHANNELS))]


def scene(networks, frames=2, seed=0, places=((-0.7, 0.1, 0.0), (0.8, -0.2, 0.0))):
    return networks.scene(random_codes(networks.config, frames, seed, places))


@pytest.fixture(scope="module")
def networks():
    return small_networks(denser(small_config()))


def denser(config):
    """Players that hide much of what is behind them, so that the order along a ray matters."""
    player = config.classes["player"]
    player = replace(player, field=replace(player.field, density_scale=25.0))
    return replace(config, classes={**config.classes, "player": player})


def draw(rays, objects, settings=SETTINGS):
    with torch.no_grad():
        return compose(rays, objects, everything(rays), settings)


def in_double(objects):
    return [replace(each, field=copy.deepcopy(each.field).double()) for each in objects]


@pytest.mark.parametrize("views", [VIEWS, [INSIDE, VIEWS[1]]], ids=["outside", "inside"])
@pytest.mark.parametrize("graded", [True, False], ids=["training", "inference"])
def test_composition_agrees_with_a_float64_walk_along_every_ray(networks, views, graded):
    rays, objects = rays_of(views, per_frame=24), scene(networks)
    with torch.set_grad_enabled(graded):
        fast = compose(rays, objects, everything(rays), SETTINGS)
    slow = in_double(objects)
    crossed = 0
    for ray in range(len(rays.frame)):
        frame = int(rays.frame[ray])
        seen = look_along(rays.centres[frame], rays.directions[ray], frame, slow, SETTINGS.near)
        shares = torch.tensor(seen.shares)
        crossed += int((shares > 0.01).sum() > 1)
        scale = max(1.0, float(seen.features.abs().max()))
        error = (fast.features[0][ray].detach() - seen.features).abs().max()
        assert error <= 1e-5 * scale, f"ray {ray}"
        torch.testing.assert_close(fast.weights[ray].detach(), shares.float(), atol=1e-5, rtol=0)
        assert float(fast.depth[ray].detach()) == pytest.approx(seen.depth, abs=1e-4)
        assert float(fast.solid[ray].detach()) == pytest.approx(seen.solid, abs=1e-5)
    assert crossed > 5, "the test must look at rays that cross several objects"


def test_training_and_inference_compute_the_same(networks):
    rays, objects = rays_of(VIEWS), scene(networks)
    graded = compose(rays, objects, everything(rays), SETTINGS)
    plain = draw(rays, objects)
    torch.testing.assert_close(graded.features[0].detach(), plain.features[0], atol=1e-6, rtol=1e-5)


def test_leaving_out_samples_of_exactly_no_weight_changes_nothing(networks):
    rays, objects = rays_of(VIEWS, per_frame=40), scene(networks)
    skipped = draw(rays, objects)
    evaluated = draw(rays, objects, replace(SETTINGS, weight_threshold=-1.0))
    assert skipped.statistics["feature_samples"] < evaluated.statistics["feature_samples"]
    torch.testing.assert_close(skipped.features[0], evaluated.features[0], atol=1e-6, rtol=1e-6)
    assert torch.equal(skipped.weights, evaluated.weights)


@pytest.mark.parametrize("bucket", [1, 7, 256])
def test_padding_changes_nothing(networks, bucket):
    rays, objects = rays_of(VIEWS), scene(networks)
    wanted = draw(rays, objects)
    found = draw(rays, objects, replace(SETTINGS, bucket=bucket))
    torch.testing.assert_close(found.features[0], wanted.features[0], atol=1e-6, rtol=1e-5)
    torch.testing.assert_close(found.weights, wanted.weights, atol=1e-7, rtol=1e-6)
    torch.testing.assert_close(found.depth, wanted.depth, atol=1e-5, rtol=1e-6)
    assert found.statistics["feature_samples"] == wanted.statistics["feature_samples"]


def test_rays_one_by_one_give_what_they_give_together(networks):
    rays, objects = rays_of(VIEWS, per_frame=8), scene(networks)
    together = draw(rays, objects)
    for ray in range(len(rays.frame)):
        one = Rays(rays.centres, rays.directions[ray : ray + 1], rays.frame[ray : ray + 1])
        alone = draw(one, objects)
        torch.testing.assert_close(
            alone.features[0][0], together.features[0][ray], atol=1e-6, rtol=1e-5
        )


def test_the_order_of_the_objects_does_not_matter(networks):
    rays, objects = rays_of(VIEWS), scene(networks)
    order = [4, 1, 0, 3, 2]
    straight, turned = draw(rays, objects), draw(rays, [objects[i] for i in order])
    torch.testing.assert_close(turned.features[0], straight.features[0], atol=1e-6, rtol=1e-5)
    torch.testing.assert_close(turned.weights, straight.weights[:, order], atol=1e-7, rtol=1e-6)


def test_object_shares_are_shares_and_fill_a_world_with_a_sky(networks):
    weights = draw(rays_of(VIEWS, 60), scene(networks)).weights
    assert (weights >= 0).all()
    torch.testing.assert_close(weights.sum(dim=-1), torch.ones(120), atol=1e-6, rtol=0)


def test_no_object_at_all_gives_zeros_of_the_right_shape(networks):
    rays = rays_of(VIEWS)
    empty = draw(rays, [])
    assert torch.equal(empty.features[0], torch.zeros(24, CHANNELS))
    assert empty.weights.shape == (24, 0)
    assert not empty.depth.any() and not empty.solid.any()


def test_no_rays_give_no_features(networks):
    rays = rays_of(VIEWS, per_frame=0)
    composed = draw(rays, scene(networks))
    assert composed.features[0].shape == (0, CHANNELS)
    assert composed.statistics["samples"] == 0


@pytest.mark.parametrize(
    "place",
    [(0.0, -30.0, 0.0), (40.0, 0.0, 0.0), (0.0, 0.0, 50.0), (1.0, -4.9, 9.0)],
    ids=["behind the camera", "beside the view", "above the view", "right above the camera"],
)
@pytest.mark.parametrize("graded", [True, False])
def test_an_object_that_no_ray_hits_leaves_the_others_as_they_are(networks, place, graded):
    rays = rays_of(VIEWS)
    objects = scene(networks, places=((-0.7, 0.1, 0.0), place))
    with torch.set_grad_enabled(graded):
        composed = compose(rays, objects, everything(rays), SETTINGS)
        without = compose(rays, objects[:-1], everything(rays), SETTINGS)
    torch.testing.assert_close(composed.features, without.features, atol=1e-6, rtol=1e-5)
    assert not composed.weights[:, -1].any()
    assert composed.statistics["samples"] == without.statistics["samples"]


def test_a_hidden_object_costs_no_samples_and_changes_nothing(networks):
    rays, objects = rays_of(VIEWS), scene(networks)
    hidden = replace(objects[-1], visible=torch.tensor([False, False]))
    composed, without = draw(rays, [*objects[:-1], hidden]), draw(rays, objects[:-1])
    assert torch.equal(composed.features[0], without.features[0])
    assert composed.statistics == without.statistics


def test_an_object_hidden_in_one_frame_is_drawn_in_the_other(networks):
    rays, objects = rays_of(VIEWS, per_frame=40), scene(networks)
    half = replace(objects[-1], visible=torch.tensor([True, False]))
    shares = draw(rays, [*objects[:-1], half]).weights[:, -1]
    assert shares[rays.frame == 0].max() > 0.1
    assert not shares[rays.frame == 1].any()


def test_what_stands_behind_the_wall_is_not_seen_and_gets_no_features(networks):
    rays = rays_of(VIEWS)
    objects = scene(networks, places=((-0.7, 0.1, 0.0), (0.3, 5.0, -0.3)))
    wall = draw(rays, [objects[1], objects[-1]])
    behind = wall.weights[:, 0] > 0.5
    assert behind.any()
    assert not wall.weights[behind, 1].any()


def test_nothing_is_drawn_before_the_near_depth(networks):
    rays, objects = rays_of(VIEWS), scene(networks)
    composed = draw(rays, objects, replace(SETTINGS, near=50.0))
    assert not composed.solid.any()
    sky = [i for i, each in enumerate(objects) if each.field.config.kind == "sky"]
    assert torch.equal(composed.weights[:, sky[0]], torch.ones(24))


def test_a_pass_without_features_evaluates_none_and_keeps_depth_and_weights(networks):
    rays, objects = rays_of(VIEWS), scene(networks)
    with torch.no_grad():
        bare = compose(rays, objects, [], SETTINGS)
    full = draw(rays, objects)
    assert bare.features == []
    assert bare.statistics["feature_samples"] == 0
    assert torch.equal(bare.weights, full.weights)
    assert torch.equal(bare.depth, full.depth)


def test_groups_get_their_rays_and_their_channels(networks):
    rays, objects = rays_of(VIEWS), scene(networks)
    whole = draw(rays, objects).features[0]
    groups = [(slice(0, 10), slice(0, 5)), (slice(10, 24), slice(5, 9))]
    with torch.no_grad():
        first, second = compose(rays, objects, groups, SETTINGS).features
    torch.testing.assert_close(first, whole[:10, :5])
    torch.testing.assert_close(second, whole[10:, 5:])


def test_moving_camera_and_objects_together_by_a_kilometre_changes_almost_nothing(networks):
    rays, objects = rays_of(VIEWS), scene(networks)
    # A whole number of metres that float32 positions can hold exactly.
    away = torch.tensor([1024.0, -2048.0, 0.0])
    objects = [replace(o, position=(o.position * 1024).round() / 1024) for o in objects]
    far = [replace(each, position=each.position + away) for each in objects]
    moved = Rays(rays.centres + away.double(), rays.directions, rays.frame)
    torch.testing.assert_close(
        draw(moved, far).features[0], draw(rays, objects).features[0], atol=1e-5, rtol=1e-5
    )


def test_a_turned_object_seen_by_a_turned_camera_looks_as_before(networks):
    objects = scene(networks, frames=1, places=((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))[-2:-1]
    rays, angle = rays_of([camera(0.3)]), 0.8
    turn = torch.tensor(
        [
            [math.cos(angle), -math.sin(angle), 0.0],
            [math.sin(angle), math.cos(angle), 0.0],
            [0.0, 0.0, 1.0],
        ]
    ).double()
    turned_rays = Rays(rays.centres @ turn.T, rays.directions @ turn.T, rays.frame)
    turned = [replace(each, heading=torch.tensor([angle])) for each in objects]
    straight, around = draw(rays, objects), draw(turned_rays, turned)
    assert straight.weights.max() > 0.1
    torch.testing.assert_close(around.weights, straight.weights, atol=1e-5, rtol=0)
    torch.testing.assert_close(around.features[0], straight.features[0], atol=1e-4, rtol=0)
    upright = [replace(each, heading=torch.zeros(1)) for each in objects]
    torch.testing.assert_close(draw(rays, upright).weights, straight.weights, atol=1e-6, rtol=0)


def test_fewer_samples_are_drawn_when_a_share_is_asked_for(networks):
    rays, objects = rays_of(VIEWS), scene(networks)[-1:]
    whole = draw(rays, objects).statistics
    half = draw(rays, objects, replace(SETTINGS, sample_share=0.4)).statistics
    assert half["hits"] == whole["hits"]
    assert half["samples"] * 5 == whole["samples"] * 2


def test_jitter_is_seeded_by_torch_and_moves_the_samples(networks):
    rays, objects = rays_of(VIEWS), scene(networks)
    jittered = replace(SETTINGS, jitter=True)
    torch.manual_seed(1)
    one = draw(rays, objects, jittered).features[0]
    torch.manual_seed(1)
    again = draw(rays, objects, jittered).features[0]
    torch.manual_seed(2)
    other = draw(rays, objects, jittered).features[0]
    assert torch.equal(one, again)
    assert not torch.equal(one, other)


def test_gradients_reach_style_and_pose_and_are_finite(networks):
    rays, objects = rays_of(VIEWS), scene(networks)
    style = objects[-1].style.clone().requires_grad_()
    pose = objects[-1].pose.clone().requires_grad_()
    objects[-1] = replace(objects[-1], style=style, pose=pose)
    composed = compose(rays, objects, everything(rays), SETTINGS)
    composed.features[0].square().sum().backward()
    for gradient in (style.grad, pose.grad):
        assert torch.isfinite(gradient).all() and gradient.abs().max() > 0
    networks.zero_grad()
