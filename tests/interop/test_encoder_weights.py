"""Imported encoders against a float64 twin that is written from what theirs compute, step by step.

The twin keeps the batch normalisations and pools where they do; nothing in it is folded.
"""

from dataclasses import replace

import pytest
import torch
from torch.nn import functional

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


def random_tensors(entries, seed=0):
    """Values of the sizes that trained networks have, so that every layer matters."""
    generator = torch.Generator().manual_seed(seed)
    tensors = {}
    for name, shape in entries.items():
        noise = torch.randn(shape, generator=generator)
        if name.endswith("num_batches_tracked"):
            tensors[name] = torch.zeros(shape, dtype=torch.int64)
        elif name.endswith("running_var"):
            tensors[name] = 0.6 + noise.abs()
        elif len(shape) > 1:
            tensors[name] = noise * (1.5 / noise[0].numel()) ** 0.5
        elif name.endswith("weight"):
            tensors[name] = 1 + 0.2 * noise
        else:
            tensors[name] = 0.3 * noise
    return tensors


def normalise(tensors, name, maps):
    """Batch normalisation at evaluation."""
    by = {key: tensors[f"{name}.{key}"].double()[:, None, None] for key in STATISTICS}
    centred = (maps - by["running_mean"]) / torch.sqrt(by["running_var"] + 1e-5)
    return centred * by["weight"] + by["bias"]


STATISTICS = ("weight", "bias", "running_mean", "running_var")


def convolve(tensors, name, maps, stride=1):
    kernel = tensors[f"{name}.weight"].double()
    return functional.conv2d(maps, kernel, stride=stride, padding=kernel.shape[-1] // 2)


def leaky(maps):
    return torch.where(maps > 0, maps, 0.2 * maps)


def pool(maps, size):
    """Mean of each size x size square."""
    rows, columns = maps.shape[-2] // size, maps.shape[-1] // size
    squares = maps[..., : rows * size, : columns * size]
    return squares.unflatten(-1, (columns, size)).unflatten(-3, (rows, size)).mean(dim=(-3, -1))


def block(tensors, name, maps, size, last=True):
    inner = normalise(tensors, f"{name}.bn1", pool(convolve(tensors, f"{name}.conv1", maps), size))
    inner = convolve(tensors, f"{name}.conv2", leaky(inner))
    inner = normalise(tensors, f"{name}.bn2", inner)
    if f"{name}.downsample.0.weight" in tensors:
        maps = pool(convolve(tensors, f"{name}.downsample.0", maps), size)
        maps = normalise(tensors, f"{name}.downsample.2", maps)
    return leaky(inner + maps) if last else inner + maps


def residual_features(tensors, pictures):
    maps = leaky(normalise(tensors, "bn1", convolve(tensors, "conv1", pictures, stride=2)))
    maps = block(tensors, "initial_backbone.0", maps, 2)
    maps = block(tensors, "initial_backbone.1", maps, 1)
    for index in range(6):
        maps = block(tensors, f"final_backbone.{index}", maps, 2 if index % 2 == 0 else 1)
    return maps.mean(dim=(-2, -1))


def attentive_features(tensors, pictures, view):
    maps = view[:, :, None, None] * torch.ones(1, 1, *pictures.shape[-2:]).double()
    maps = convolve(tensors, "conv1", torch.cat([pictures, maps], dim=1))
    maps = leaky(normalise(tensors, "bn1", pool(maps, 2)))
    maps = block(tensors, "initial_backbone.0", maps, 1, last=False)
    maps = leaky(maps[:, :16]) / (1 + torch.exp(-maps[:, 16:]))
    for index in range(4):
        maps = block(tensors, f"final_backbone.{index}", maps, 2 if index % 2 == 0 else 1)
    return maps.mean(dim=(-2, -1))


def head(tensors, name, features):
    return features @ tensors[f"{name}.weight"].double().T + tensors[f"{name}.bias"].double()


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
    features = residual_features(theirs, crops.double() * 2 - 1)
    across, along = (1.4 * torch.tanh(head(theirs, "rotation_head", features))).unbind(dim=1)
    torch.testing.assert_close(ours.double(), torch.atan2(along, across), atol=1e-5, rtol=0)


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
