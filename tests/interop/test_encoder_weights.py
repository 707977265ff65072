"""Imported encoders, one by one, against the twin."""

from dataclasses import replace

import pytest
import torch
from interop.perception_twin import (
    attentive_features,
    head,
    random_tensors,
    residual_features,
    yaw,
)

from pe_runtime.config import EncoderConfig, ObjectClassConfig
from pe_runtime.interop.encoder_weights import (
    convert_encoder,
    convert_heading,
    encoder_entries,
    place_entries,
)
from pe_runtime.perception.heading_encoder import HeadingEncoder
from pe_runtime.perception.object_encoder import build_encoder

RESIDUAL = EncoderConfig(
    design="residual", view="none", height=32, width=256, channels=(64, 128, 256, 512)
)
ATTENTIVE = EncoderConfig(
    design="attentive", view="camera", height=64, width=64, channels=(16, 32, 64)
)
WALL = ObjectClassConfig(style_features=64, encoder=RESIDUAL)
PLAYER = ObjectClassConfig(
    kind="playable",
    style_features=32,
    pose_features=32,
    encoder=ATTENTIVE,
    heading=replace(RESIDUAL, height=64, width=64),
)


@pytest.fixture(autouse=True)
def without_gradients():
    with torch.no_grad():
        yield


def pictures(encoder, count=2):
    generator = torch.Generator().manual_seed(1)
    return torch.rand(count, 3, encoder.height, encoder.width, generator=generator)


VIEW = torch.tensor([[1.37, 0.02, -0.01, 0.4, -38.9, 8.5], [1.35, -0.03, 0.02, -0.7, -31.0, 10.2]])


def loaded(module, tensors):
    module.load_state_dict({name: each.float() for name, each in tensors.items()})
    return module.eval()


def compare(ours, wanted, share=1e-5):
    assert wanted.std() > 0.01
    assert (ours - wanted).abs().max() <= share * wanted.abs().max()


@pytest.mark.parametrize("size", [(32, 256), (64, 256), (144, 256)])
def test_an_imported_static_encoder_gives_their_style(size):
    config = replace(WALL, encoder=replace(RESIDUAL, height=size[0], width=size[1]))
    theirs = random_tensors(encoder_entries(config))
    crops = pictures(config.encoder, count=1)
    ours, pose = loaded(build_encoder(config), convert_encoder(theirs, config))(
        crops, torch.zeros(1, 0)
    )
    features = residual_features(theirs, crops.double() * 2 - 1)
    compare(ours, head(theirs, "style_head", features))
    assert pose.shape == (1, 0)


@pytest.mark.parametrize("seed", [0, 1])
def test_an_imported_player_encoder_gives_their_style_and_deformation(seed):
    theirs = random_tensors(encoder_entries(PLAYER), seed)
    crops = pictures(ATTENTIVE)
    style, pose = loaded(build_encoder(PLAYER), convert_encoder(theirs, PLAYER))(crops, VIEW)
    features = attentive_features(theirs, crops.double() * 2 - 1, VIEW.double())
    compare(style, head(theirs, "style_head", features))
    compare(pose, head(theirs, "deformation_head", features))


@pytest.mark.parametrize("seed", [0, 1])
def test_an_imported_yaw_encoder_gives_their_angle(seed):
    theirs = random_tensors(place_entries(PLAYER), seed)
    crops = pictures(PLAYER.heading)
    module = loaded(HeadingEncoder(PLAYER.heading), convert_heading(theirs, PLAYER))
    ours = module(crops, torch.zeros(2, 0))
    wanted = yaw(theirs, crops.double() * 2 - 1)
    torch.testing.assert_close(ours.double(), wanted, atol=1e-5, rtol=0)


def test_the_entries_of_a_static_encoder_are_those_of_the_checkpoint():
    entries = encoder_entries(WALL)
    assert len(entries) == 21 * 6 + 4
    assert entries["conv1.weight"] == (64, 3, 7, 7)
    assert entries["initial_backbone.0.downsample.0.weight"] == (64, 64, 1, 1)
    assert "initial_backbone.1.downsample.0.weight" not in entries
    assert entries["final_backbone.4.conv1.weight"] == (512, 256, 3, 3)
    assert entries["final_backbone.4.downsample.2.running_var"] == (512,)
    assert entries["final_backbone.5.bn2.num_batches_tracked"] == ()
    assert entries["style_head.weight"] == (64, 512)
    assert entries["deformation_head.weight"] == (32, 512)


def test_the_entries_of_a_player_encoder_are_those_of_the_checkpoint():
    entries = encoder_entries(PLAYER)
    assert len(entries) == 14 * 6 + 4
    assert entries["conv1.weight"] == (16, 9, 3, 3)
    assert entries["initial_backbone.0.conv2.weight"] == (17, 17, 3, 3)
    assert entries["final_backbone.2.downsample.0.weight"] == (64, 32, 1, 1)
    assert entries["deformation_head.bias"] == (32,)


def test_places_are_ranges_or_a_yaw_encoder():
    assert place_entries(WALL) == {"translation_range": (1, 3, 2), "rotation_range": (1, 3, 2)}
    entries = place_entries(PLAYER)
    assert len(entries) == 21 * 6 + 2
    assert entries["rotation_head.weight"] == (2, 512)


@pytest.mark.parametrize("config", [WALL, PLAYER], ids=["static", "player"])
def test_exactly_the_weights_of_our_modules_come_out(config):
    theirs = random_tensors(encoder_entries(config))
    ours = {name: each.shape for name, each in build_encoder(config).state_dict().items()}
    assert {n: t.shape for n, t in convert_encoder(theirs, config).items()} == ours
    yaw = config.heading and HeadingEncoder(config.heading).state_dict()
    wanted = {name: each.shape for name, each in (yaw or {}).items()}
    theirs = random_tensors(place_entries(config))
    assert {n: t.shape for n, t in convert_heading(theirs, config).items()} == wanted


def test_nothing_that_is_read_is_unlisted():
    theirs = random_tensors(encoder_entries(PLAYER))
    del theirs["final_backbone.3.bn2.running_mean"]
    with pytest.raises(KeyError, match="final_backbone.3.bn2.running_mean"):
        convert_encoder(theirs, PLAYER)
