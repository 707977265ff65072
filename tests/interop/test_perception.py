"""Whole frames of both worlds, from pictures, cameras and boxes to codes, against the twin."""

from pathlib import Path

import numpy as np
import pytest
import torch
from interop import perception_twin as twin

from pe_runtime.config import ModelConfig
from pe_runtime.config.reading import read_toml
from pe_runtime.geometry.cameras import Cameras
from pe_runtime.interop import conventions
from pe_runtime.interop.conventions import camera_from_theirs, positions_from_theirs
from pe_runtime.interop.encoder_weights import (
    convert_encoder,
    convert_heading,
    encoder_entries,
    place_entries,
)
from pe_runtime.networks import SynthesisNetworks

SIZE = (512, 288)
UP = {"z": 2, "y": 1}
# Normalised boxes in their order: usual, partly outside the picture, tiny, wide and low.
BOXES = np.array(
    [
        [[0.33, 0.62, 0.41, 0.86], [0.56, 0.51, 0.6, 0.63]],
        [[-0.04, 0.55, 0.07, 0.97], [0.951, 0.7, 1.08, 1.05]],
        [[0.4003, 0.7001, 0.4011, 0.7018], [0.21, 0.605, 0.47, 0.655]],
    ],
    np.float32,
)
# Angles, place and focal length in their world; each looks down at its middle.
CAMERAS = {
    "tennis": [
        ([1.3743, 0.021, -0.013], [0.35, -38.9, 8.55], 1172.3),
        ([1.31, -0.03, 0.02], [-0.8, -31.2, 10.4], 1011.0),
        ([1.25, 0.0, 0.0], [0.1, -35.0, 9.0], 800.0),
    ],
    "minecraft": [
        ([-0.4224, 0.8593, 0.0267], [7.9469, 3.6033, 4.8187], 654.13),
        ([-0.55, -2.4, 0.0], [-6.2, 6.1, -7.3], 420.7),
        ([-0.35, 3.05, -0.04], [0.7, 4.2, -8.1], 350.0),
    ],
}


class World:
    """Networks of ours with random weights of theirs, and the frames that both see."""

    def __init__(self, name):
        path = Path(conventions.__file__).with_name(f"{name}.toml")
        self.config = read_toml(path, "model", ModelConfig)
        self.up = self.config.native_up
        self.cameras = [
            (
                np.float32(angles).astype(float),
                np.float32(place).astype(float),
                float(np.float32(f)),
            )
            for angles, place, f in CAMERAS[name]
        ]
        self.images = torch.rand(3, 3, SIZE[1], SIZE[0], generator=torch.Generator().manual_seed(5))
        self.theirs, self.yaws = {}, {}
        networks = SynthesisNetworks(self.config).eval()
        for seed, (each, config) in enumerate(self.config.classes.items()):
            self.theirs[each] = twin.random_tensors(encoder_entries(config), seed)
            weights = convert_encoder(self.theirs[each], config)
            networks.encoders[each].load_state_dict(floats(weights))
            if config.heading is not None:
                self.yaws[each] = twin.random_tensors(place_entries(config), seed + 9)
                weights = convert_heading(self.yaws[each], config)
                networks.headings[each].load_state_dict(floats(weights))
        ours = [camera_from_theirs(*each, SIZE, self.up) for each in self.cameras]
        boxes = torch.from_numpy(BOXES) * torch.tensor([*SIZE, *SIZE])
        with torch.no_grad():
            self.codes = networks.encode(self.images, Cameras.stack(ours), boxes)

    def crop(self, frame, box, encoder):
        picture = self.images[frame].double().numpy() * 2 - 1
        return twin.pooled(picture, box, encoder.height, encoder.width)[None]


def floats(weights):
    return {name: each.float() for name, each in weights.items()}


@pytest.fixture(scope="module", params=["tennis", "minecraft"])
def world(request):
    torch.manual_seed(0)
    return World(request.param)


def close(ours, wanted, share=1e-4):
    assert (ours - wanted).abs().max() <= share * wanted.abs().max()


@pytest.mark.parametrize("frame", range(3))
@pytest.mark.parametrize("player", range(2))
def test_players_have_their_codes(world, frame, player):
    name = world.config.playable_names[player]
    config, codes = world.config.class_of(name), world.codes[name]
    theirs = world.theirs[next(o.class_name for o in world.config.objects if o.name == name)]
    camera, box = world.cameras[frame], BOXES[frame, player].astype(float)
    point = twin.foot(box, camera, SIZE, UP[world.up])
    point[UP[world.up]] = config.lift
    wanted = positions_from_theirs(point, world.up)
    assert np.abs(codes.position[frame].numpy() - wanted).max() <= 2e-5
    seen = twin.expanded(box, *config.encoder.widen) if any(config.encoder.widen) else box
    crop = world.crop(frame, seen, config.encoder)
    view = torch.tensor([[*camera[0], *camera[1]]], dtype=torch.float64)
    features = twin.attentive_features(theirs, crop, view)[0]
    close(codes.style[frame], twin.head(theirs, "style_head", features))
    close(codes.pose[frame], twin.head(theirs, "deformation_head", features))
    assert codes.visible[frame]


@pytest.mark.parametrize("frame", range(3))
def test_players_have_their_yaw_where_they_have_one(world, frame):
    for player, name in enumerate(world.config.playable_names):
        config, heading = world.config.class_of(name), world.codes[name].heading
        if config.heading is None:
            assert heading is None
            continue
        box = twin.expanded(BOXES[frame, player].astype(float), 2.0, 2.8)
        offset = twin.yaw(world.yaws["player"], world.crop(frame, box, config.heading))
        wanted = world.cameras[frame][0][1] + float(offset)
        assert np.cos(float(heading[frame]) - wanted) == pytest.approx(1, abs=1e-9)


@pytest.mark.parametrize("frame", range(3))
def test_static_objects_have_their_style(world, frame):
    turn = conventions.WORLD_FROM_NATIVE[world.up].numpy().T
    for each in world.config.objects[:2]:
        config = world.config.classes[each.class_name]
        ends = np.sort(np.stack([turn @ config.low, turn @ config.high]), axis=0)
        place = turn @ np.array(each.position)
        box = twin.projected(*ends, place, world.cameras[frame], SIZE)
        crop, theirs = world.crop(frame, box, config.encoder), world.theirs[each.class_name]
        wanted = twin.head(theirs, "style_head", twin.residual_features(theirs, crop))[0]
        close(world.codes[each.name].style[frame], wanted)
        assert world.codes[each.name].visible[frame]
