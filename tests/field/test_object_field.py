from dataclasses import replace

import torch
from small_world import BACKDROP, FIELD, GROUND, PLAYER, shake

from pe_runtime.config import ObjectClassConfig
from pe_runtime.field.object_field import DENSITY_SHIFT, ObjectField

RAYS, SAMPLES = 7, 3


def field(config: ObjectClassConfig = PLAYER, seed=0, **changes):
    torch.manual_seed(seed)
    module = ObjectField(replace(config, **changes), 9)
    shake(module)
    return module


def inputs(config=PLAYER, frames=2, seed=1):
    generator = torch.Generator().manual_seed(seed)
    points = torch.rand(RAYS, SAMPLES, 3, generator=generator) * 2 - 1
    frame = torch.arange(RAYS) % frames
    style = torch.randn(frames, config.style_features, generator=generator)
    pose = torch.randn(frames, config.pose_features, generator=generator)
    return points, frame, style, pose


def evaluate(module, points, frame, style, pose):
    hidden = module.trunk(points, frame, pose)
    return module.densities(hidden), module.branch(hidden, frame, style)


def test_style_changes_features_but_never_densities():
    module = field()
    points, frame, style, pose = inputs()
    sigma, features = evaluate(module, points, frame, style, pose)
    other_sigma, other_features = evaluate(module, points, frame, style + 1, pose)
    assert torch.equal(sigma, other_sigma)
    assert not torch.allclose(features, other_features)


def test_pose_changes_the_densities_and_features_of_a_class_that_bends():
    module = field()
    points, frame, style, pose = inputs()
    sigma, features = evaluate(module, points, frame, style, pose)
    other_sigma, other_features = evaluate(module, points, frame, style, pose + 1)
    assert not torch.allclose(sigma, other_sigma)
    assert not torch.allclose(features, other_features)


def test_pose_changes_nothing_of_a_class_that_does_not_bend():
    module = field(bending=None)
    points, frame, style, pose = inputs()
    one = evaluate(module, points, frame, style, pose)
    other = evaluate(module, points, frame, style, pose + 1)
    assert all(torch.equal(a, b) for a, b in zip(one, other, strict=True))


def test_the_style_of_one_frame_folded_into_the_layer_equals_the_style_per_ray():
    module = field()
    points, _, style, pose = inputs(frames=1)
    frame = torch.zeros(RAYS, dtype=torch.long)
    hidden = module.trunk(points, frame, pose)
    folded = module.branch(hidden, frame, style)
    # Two frames with equal styles take the path that is not folded.
    plain = module.branch(hidden, frame, style.expand(2, -1))
    torch.testing.assert_close(folded, plain, atol=1e-6, rtol=1e-6)


def test_the_pose_of_one_frame_equals_the_pose_per_ray():
    module = field()
    points, _, _, pose = inputs(frames=1)
    frame = torch.zeros(RAYS, dtype=torch.long)
    one = module.trunk(points, frame, pose)
    per_frame = module.trunk(points, frame, pose.expand(2, -1))
    torch.testing.assert_close(one, per_frame, atol=1e-6, rtol=1e-6)


def test_the_last_layer_after_integration_equals_integrating_its_outputs():
    module = field().double()
    generator = torch.Generator().manual_seed(4)
    branch = torch.randn(RAYS, SAMPLES, 8, generator=generator, dtype=torch.float64)
    weights = torch.rand(RAYS, SAMPLES, generator=generator, dtype=torch.float64) / SAMPLES
    channels = slice(2, 6)
    each = module.output(branch)[..., channels]
    wanted = (weights[..., None] * each).sum(dim=1)
    integrated = (weights[..., None] * branch).sum(dim=1)
    found = module.features(integrated, weights.sum(dim=1), channels)
    torch.testing.assert_close(found, wanted)


def test_densities_are_never_negative_and_start_as_thin_fog():
    torch.manual_seed(0)
    fresh = ObjectField(PLAYER, 9)
    points, frame, _, pose = inputs()
    sigma = fresh.densities(fresh.trunk(points, frame, pose))
    assert (sigma >= 0).all()
    assert sigma.median() * 1.1 < 3, "a volume of 1.1 m is not a solid block"
    raw = fresh.density(fresh.trunk(points, frame, pose))[..., 0]
    wanted = torch.log1p(torch.exp(raw - DENSITY_SHIFT)) * PLAYER.field.density_scale
    torch.testing.assert_close(sigma, wanted)


def test_density_noise_is_drawn_anew_and_only_when_asked_for():
    module = field()
    points, frame, _, pose = inputs()
    hidden = module.trunk(points, frame, pose)
    assert torch.equal(module.densities(hidden), module.densities(hidden, 0.0))
    torch.manual_seed(0)
    assert not torch.equal(module.densities(hidden, 0.5), module.densities(hidden, 0.5))


def test_only_the_named_axes_enter_a_flat_field():
    for config, ignored in ((GROUND, 2), (BACKDROP, 1)):
        module = field(config)
        points, frame, _, pose = inputs(config)
        moved = points.clone()
        moved[..., ignored] = 0.123
        assert torch.equal(module.trunk(points, frame, pose), module.trunk(moved, frame, pose))
        moved[..., 0] += 0.1
        assert not torch.equal(module.trunk(points, frame, pose), module.trunk(moved, frame, pose))


def test_the_corners_of_the_volume_are_one_half_box_away():
    module = field()
    places = torch.tensor([PLAYER.low, PLAYER.high])
    wanted = torch.tensor([[-1.0] * 3, [1.0] * 3])
    torch.testing.assert_close(module.coordinates(places), wanted)


def test_a_skip_connection_lets_the_trunk_see_the_position_again():
    module = field(bending=None, field=replace(FIELD, skip=2))
    points, frame, _, pose = inputs()
    before = module.trunk(points, frame, pose)
    with torch.no_grad():
        module.skip.weight.zero_()
    assert not torch.allclose(before, module.trunk(points, frame, pose))


def test_opaque_classes_learn_no_density():
    assert field(GROUND).density is None
    assert not any("density" in name for name, _ in field(GROUND).named_parameters())
