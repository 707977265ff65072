from dataclasses import replace

import pytest
import torch
from small_world import GROUND, PLAYER, shake

from pe_runtime.config import EncoderConfig, ObjectClassConfig
from pe_runtime.contract.errors import ConfigError
from pe_runtime.perception.object_encoder import ObjectEncoder, ResidualEncoder, build_encoder
from pe_runtime.perception.views import VIEW_FEATURES


def encoder(config=PLAYER, seed=0, **changes):
    torch.manual_seed(seed)
    module = build_encoder(replace(config, encoder=replace(config.encoder, **changes)))
    shake(module)
    return module.eval()


def crops(config=PLAYER, count=4, seed=1):
    generator = torch.Generator().manual_seed(seed)
    size = (config.encoder.height, config.encoder.width)
    return (
        torch.rand(count, 3, *size, generator=generator),
        torch.randn(count, VIEW_FEATURES, generator=generator),
    )


@pytest.mark.parametrize("shared", [False, True])
def test_style_and_pose_have_the_lengths_the_class_says(shared):
    style, pose = encoder(shared_trunk=shared)(*crops())
    assert style.shape == (4, PLAYER.style_features)
    assert pose.shape == (4, PLAYER.pose_features)


def test_a_static_class_has_a_style_and_an_empty_pose():
    style, pose = encoder(GROUND)(*crops(GROUND))
    assert style.shape == (4, GROUND.style_features)
    assert pose.shape == (4, 0)


def test_separate_trunks_share_no_weights_and_one_shared_trunk_has_no_second():
    separate, shared = encoder(), encoder(shared_trunk=True)
    assert separate.pose is not None and shared.pose is None
    with torch.no_grad():
        before = separate(*crops())
        separate.pose.output.bias += 1
        after = separate(*crops())
    assert torch.equal(before[0], after[0])
    assert not torch.equal(before[1], after[1])


def test_poses_of_a_training_batch_have_zero_mean_and_unit_variance():
    module = encoder().train()
    _, pose = module(*crops(count=16))
    torch.testing.assert_close(pose.mean(dim=0), torch.zeros(3), atol=1e-5, rtol=0)
    torch.testing.assert_close(pose.var(dim=0, unbiased=False), torch.ones(3), atol=0.05, rtol=0)


def test_in_use_a_crop_s_codes_do_not_depend_on_its_neighbours():
    module, (pictures, views) = encoder(), crops()
    together = module(pictures, views)
    alone = module(pictures[2:3], views[2:3])
    for whole, one in zip(together, alone, strict=True):
        torch.testing.assert_close(whole[2:3], one, atol=1e-6, rtol=1e-5)


def test_the_view_changes_the_pose():
    module, (pictures, views) = encoder(), crops()
    assert not torch.allclose(module(pictures, views)[1], module(pictures, views + 1)[1])


def test_half_precision_trunks_still_give_float32_codes():
    with torch.autocast("cpu", torch.bfloat16):
        codes = encoder()(*crops())
    assert {each.dtype for each in codes} == {torch.float32}


def test_a_compact_encoder_can_do_without_the_view():
    module, (pictures, views) = encoder(view="none"), crops()
    style, _ = module(pictures, views[:, :0])
    assert style.shape == (4, PLAYER.style_features)


SLIM = {
    "residual": EncoderConfig(design="residual", view="none", height=8, width=16, channels=(8, 12)),
    "attentive": EncoderConfig(
        design="attentive", view="camera", height=16, width=12, channels=(5, 8, 12)
    ),
}
designs = pytest.mark.parametrize("design", SLIM)


def authors_encoder(design, pose=3, seed=0):
    torch.manual_seed(seed)
    config = ObjectClassConfig(style_features=5, pose_features=pose, encoder=SLIM[design])
    return build_encoder(config), config


@designs
@pytest.mark.parametrize("pose", [0, 3])
def test_the_authors_designs_give_a_style_and_a_pose_where_there_is_one(design, pose):
    module, config = authors_encoder(design, pose)
    assert isinstance(module, ResidualEncoder)
    pictures, views = crops(config)
    if design == "residual":
        views = views[:, :0]
    style, deformation = module(pictures, views)
    assert style.shape == (4, 5) and deformation.shape == (4, pose)


@designs
def test_the_authors_designs_let_each_crop_s_codes_be_its_own(design):
    module, config = authors_encoder(design)
    pictures, views = crops(config)
    views = views[:, :0] if design == "residual" else views
    together = module(pictures, views)
    alone = module(pictures[2:3], views[2:3])
    for whole, one in zip(together, alone, strict=True):
        torch.testing.assert_close(whole[2:3], one, atol=1e-6, rtol=1e-5)


def test_an_attentive_encoder_sees_the_camera():
    module, config = authors_encoder("attentive")
    pictures, views = crops(config)
    assert not torch.allclose(module(pictures, views)[0], module(pictures, views + 0.1)[0])


@designs
def test_every_weight_of_the_authors_designs_learns_from_the_first_step(design):
    module, config = authors_encoder(design)
    pictures, views = crops(config)
    views = views[:, :0] if design == "residual" else views
    codes = torch.cat(module(pictures, views), dim=1)
    (codes * torch.linspace(-1, 1, codes.shape[1])).sum().backward()
    assert all(each.grad is not None and each.grad.abs().max() > 0 for each in module.parameters())


@pytest.mark.parametrize(
    ("design", "channels"), [("residual", (64, 128, 256, 512)), ("attentive", (16, 32, 64))]
)
def test_signals_keep_their_size_through_a_fresh_trunk(design, channels):
    torch.manual_seed(0)
    wide = replace(SLIM[design], height=64, width=64, channels=channels)
    config = ObjectClassConfig(style_features=8, encoder=wide)
    module = build_encoder(config)
    pictures, views = crops(config)
    views = views[:, :0] if design == "residual" else views
    features = []
    module.trunk.register_forward_hook(lambda *call: features.append(call[-1]))
    with torch.no_grad():
        module(pictures, views)
    assert 0.02 < features[0].square().mean().sqrt() < 5


def test_compact_is_the_default_design():
    assert isinstance(encoder(), ObjectEncoder)


def test_settings_that_no_design_can_be_built_with_are_refused():
    with pytest.raises(ConfigError, match="halves to one cell"):
        replace(SLIM["residual"], height=4)
    with pytest.raises(ConfigError, match="multiples of 4"):
        EncoderConfig(channels=(6,))


@designs
def test_half_precision_residual_trunks_still_give_float32_codes(design):
    module, config = authors_encoder(design)
    pictures, views = crops(config)
    views = views[:, :0] if design == "residual" else views
    with torch.autocast("cpu", torch.bfloat16):
        codes = module(pictures, views)
    assert {each.dtype for each in codes} == {torch.float32}


def test_a_training_batch_of_one_crop_is_normalised_as_the_crops_before_it():
    module = encoder().train()
    before = {name: each.clone() for name, each in module.named_buffers()}
    pictures, views = crops(count=1)
    _, pose = module(pictures, views)
    pose.sum().backward()
    assert all(torch.equal(each, before[name]) for name, each in module.named_buffers())
    torch.testing.assert_close(pose.detach(), module.eval()(pictures, views)[1].detach())
