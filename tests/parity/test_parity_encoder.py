"""Two recorded frames of the authors' release through our whole path: boxes -> codes."""

from pathlib import Path

import pytest
import torch
from parity.parity_files import parity_case

from pe_runtime.config import ModelConfig
from pe_runtime.config.reading import read_toml
from pe_runtime.geometry.cameras import Cameras
from pe_runtime.interop import conventions
from pe_runtime.interop.conventions import FOCAL_MULTIPLIERS, camera_from_theirs
from pe_runtime.interop.encoder_weights import convert_encoder, encoder_entries
from pe_runtime.networks import SynthesisNetworks
from pe_runtime.perception.glimpse import Pictures, Place, look

WIDTH, HEIGHT = 512, 288
TENNIS = Path(conventions.__file__).with_name("tennis.toml")


@pytest.fixture(scope="module")
def case():
    return parity_case("tennis_encoder")


@pytest.fixture(scope="module")
def config():
    return read_toml(TENNIS, "model", ModelConfig)


@pytest.fixture(scope="module")
def theirs(case):
    prefix = f"object_encoders.{case['object']}."
    assert all(name.startswith(prefix) for name in case["state_dict"])
    return {name.removeprefix(prefix): each for name, each in case["state_dict"].items()}


@pytest.fixture(scope="module")
def recorded(case, config):
    """The object's name and class, pictures, and boxes in pixels."""
    given = {name: each[0, :, 0] for name, each in case["inputs"].items()}
    # Recorded focal lengths are pixels of the frames that were annotated, 996 wide.
    focals = given["focals"] * FOCAL_MULTIPLIERS["tennis"]
    poses = zip(given["camera_rotations"], given["camera_translations"], focals, strict=True)
    cameras = [
        camera_from_theirs(angles.numpy(), place.numpy(), float(focal), (WIDTH, HEIGHT), "z")
        for angles, place, focal in poses
    ]
    pictures = Pictures((given["observations"] + 1) / 2, Cameras.stack(cameras), config.native_up)
    boxes = given["bounding_boxes"].transpose(1, 2) * torch.tensor([WIDTH, HEIGHT] * 2)
    each = config.objects[case["object"]]
    return each.name, config.classes[each.class_name], pictures, boxes


@pytest.fixture(scope="module")
def codes(case, config, theirs, recorded):
    torch.manual_seed(0)
    networks = SynthesisNetworks(config).eval()
    name, player, pictures, boxes = recorded
    weights = {n: each.float() for n, each in convert_encoder(theirs, player).items()}
    networks.encoders[config.objects[case["object"]].class_name].load_state_dict(weights)
    with torch.no_grad():
        return networks.encode(pictures.images, pictures.cameras, boxes)[name]


def test_the_entries_we_expect_are_those_recorded(theirs, recorded):
    assert {name: tuple(each.shape) for name, each in theirs.items()} == encoder_entries(
        recorded[1]
    )


def test_the_crop_and_the_camera_are_those_the_authors_encoder_saw(case, recorded, codes):
    _, player, pictures, boxes = recorded
    place = Place(boxes[:, case["player"]], codes.position)
    glimpse = look(player, pictures, [place])
    assert (glimpse.crops * 2 - 1 - case["crop"][0, :, 0]).abs().max() <= 1e-6
    angles, places = (case["inputs"][f"camera_{n}"][0, :, 0] for n in ("rotations", "translations"))
    torch.testing.assert_close(glimpse.view, torch.cat([angles, places], dim=1), atol=1e-6, rtol=0)


@pytest.mark.parametrize(("ours", "name"), [("style", "style"), ("pose", "deformation")])
def test_style_and_pose_are_theirs(case, codes, ours, name):
    wanted = case["scene_encoding"][f"object_{name}"][0]
    assert (getattr(codes, ours) - wanted).abs().max() <= 1e-5 * wanted.abs().max()


def test_the_position_is_theirs(case, codes):
    wanted = case["scene_encoding"]["object_translation_parameters"][0]
    assert (codes.position - wanted).abs().max() <= 2e-5
    assert codes.visible.tolist() == case["scene_encoding"]["object_in_scene"][0].tolist()
