"""The encoders of the paper's authors in a whole environment: pictures, cameras, boxes -> codes."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from small_world import GROUND, PLAYER, box_of, camera, look_at, picture_of, small_config
from small_world import small_networks as build

from pe_runtime.config import EncoderConfig, ObjectClassConfig
from pe_runtime.contract.errors import ConfigError
from pe_runtime.geometry.cameras import Cameras
from pe_runtime.interop.conventions import camera_from_theirs
from pe_runtime.perception.crops import crop_boxes, cut_out
from pe_runtime.perception.views import camera_features

NAN = float("nan")
WIDE = (2.0, 2.8)
GLANCE = EncoderConfig(
    design="attentive",
    crop="box",
    resampling="max",
    widen=WIDE,
    view="camera",
    height=16,
    width=16,
    channels=(6, 8, 12),
)
TURN = replace(GLANCE, design="residual", view="none", channels=(6, 8))
SURVEY = replace(TURN, crop="visible-volume", widen=(0.0, 0.0), height=16, width=32)
PLACES = [(-0.7, 0.1, 0.0), (0.8, -0.2, 0.0)]
SIZE = {"width": 64, "rows": 48}


def authors_config(**player):
    base = small_config(width=64, height=48)
    classes = {
        **base.classes,
        "ground": replace(GROUND, encoder=SURVEY),
        "player": replace(
            PLAYER, **{"encoder": GLANCE, "heading": TURN, "foot_offset": 0.0} | player
        ),
    }
    return replace(base, classes=classes, native_up="y")


@pytest.fixture(scope="module")
def networks():
    return build(authors_config())


@pytest.fixture(scope="module", autouse=True)
def without_gradients():
    with torch.no_grad():
        yield


def seen(views=None):
    views = views or [camera(0.2, **SIZE), camera(-0.3, **SIZE)]
    pictures = [picture_of(PLACES, view, [0.9, 0.1]) for view in views]
    boxes = [[box_of(place, view) for place in PLACES] for view in views]
    images = torch.from_numpy(np.stack(pictures)).permute(0, 3, 1, 2)
    return images, Cameras.stack(views), torch.tensor(boxes, dtype=torch.float32)


def test_a_player_s_codes_are_its_encoder_s_of_the_widened_box_and_the_camera(networks):
    images, cameras, boxes = seen()
    codes = networks.encode(images, cameras, boxes)["player_2"]
    region = crop_boxes(networks.config.classes["player"], cameras, boxes[:, 1], codes.position)
    crops = cut_out(images, region, 16, 16, "max")
    style, pose = networks.encoders["player"](crops, camera_features(cameras, "y"))
    torch.testing.assert_close(codes.style, style, atol=1e-6, rtol=1e-5)
    torch.testing.assert_close(codes.pose, pose, atol=1e-6, rtol=1e-5)


def test_a_heading_is_the_camera_s_and_the_offset_that_the_crop_shows(networks):
    images, cameras, boxes = seen()
    codes = networks.encode(images, cameras, boxes)
    for index, name in enumerate(("player_1", "player_2")):
        region = crop_boxes(networks.config.classes["player"], cameras, boxes[:, index], PLACE)
        crops = cut_out(images, region, 16, 16, "max")
        offset = networks.headings["player"](crops, torch.zeros(2, 0))
        wanted = cameras.headings.float() + offset
        torch.testing.assert_close(codes[name].heading, wanted, atol=1e-6, rtol=1e-5)
        assert offset.abs().max() > 1e-3


PLACE = torch.zeros(2, 3)


@pytest.mark.parametrize("angles", [(-0.4224, 0.8593, 0.0267), (0.3, -2.5, 0.0), (0.0, 0.0, 0.0)])
def test_a_camera_s_heading_is_its_native_y_angle(angles):
    theirs = camera_from_theirs(np.array(angles), np.zeros(3), 50.0, (64, 48), "y")
    assert float(Cameras.stack([theirs]).headings) == pytest.approx(angles[1], abs=1e-6)


def test_a_camera_that_turns_left_has_a_positive_heading():
    views = [look_at((0.0, 0.0, 1.0), target) for target in ((0, 5, 1), (-5, 5, 0.5), (5, 0, 2))]
    headings = Cameras.stack(views).headings.tolist()
    assert headings == pytest.approx([0.0, np.pi / 4, -np.pi / 2], abs=1e-12)


def test_absent_objects_have_heading_zero_and_classes_without_headings_none(networks):
    images, cameras, boxes = seen()
    boxes[1, 0] = NAN
    codes = networks.encode(images, cameras, boxes)
    assert codes["player_1"].heading[1] == 0 and codes["player_1"].heading[0] != 0
    assert codes["player_1"].visible.tolist() == [True, False]
    assert codes["ground"].heading is None


def test_only_classes_that_ask_for_headings_have_weights_for_them(networks):
    plain = build(authors_config(heading=None))
    named = {n for n in networks.state_dict() if n.startswith("headings.")}
    assert named and all(n.startswith("headings.player.") for n in named)
    assert set(networks.state_dict()) - named == set(plain.state_dict())
    assert plain.encode(*seen())["player_1"].heading is None


def test_players_stand_at_their_lift():
    codes = build(authors_config(lift=0.01)).encode(*seen())
    assert codes["player_1"].position[:, 2].tolist() == pytest.approx([0.01, 0.01])


def test_a_turned_player_s_volume_is_what_its_encoder_looks_at():
    volume = replace(GLANCE, crop="visible-volume", widen=(0.0, 0.0))
    config = authors_config(encoder=volume)
    networks = build(config)
    images, cameras, boxes = seen()
    codes = networks.encode(images, cameras, boxes)["player_1"]
    player = config.classes["player"]
    region = crop_boxes(player, cameras, boxes[:, 0], codes.position, codes.heading)
    crops = cut_out(images, region, 16, 16, "max")
    style, _ = networks.encoders["player"](crops, camera_features(cameras, "y"))
    torch.testing.assert_close(codes.style, style, atol=1e-6, rtol=1e-5)


BAD_BOXES = {
    "absent": (NAN, NAN, NAN, NAN),
    "half absent": (10.0, NAN, 20.0, 40.0),
    "infinite": (10.0, 5.0, float("inf"), 40.0),
    "no width": (10.0, 5.0, 10.0, 40.0),
    "upside down": (10.0, 40.0, 20.0, 5.0),
    "left of the picture": (-30.0, 5.0, -10.0, 40.0),
    "below the picture": (10.0, 60.0, 20.0, 90.0),
    "above the horizon": (10.0, 1.0, 20.0, 2.0),
}


@pytest.mark.parametrize("box", BAD_BOXES.values(), ids=BAD_BOXES)
def test_a_box_that_shows_nothing_hides_its_object_and_no_other(networks, box):
    level = look_at((0.0, -4.0, 1.0), (0.0, 0.0, 1.0), 64, 48)
    images, cameras, boxes = seen([level, level])
    boxes[0, 0] = torch.tensor(box)
    codes = networks.encode(images, cameras, boxes)
    assert codes["player_1"].visible.tolist() == [False, True]
    assert codes["player_1"].heading[0] == 0
    assert codes["player_2"].visible.all()
    for each in codes.values():
        assert torch.isfinite(torch.cat([each.position, each.style, each.pose], dim=1)).all()


@pytest.mark.parametrize("box", [(20.2, 30.1, 20.3, 30.2), (-20.0, -9.0, 3.0, 200.0)])
def test_boxes_that_are_tiny_or_leave_the_picture_are_still_seen(networks, box):
    images, cameras, boxes = seen()
    boxes[0, 0] = torch.tensor(box)
    codes = networks.encode(images, cameras, boxes)["player_1"]
    assert codes.visible.all() and torch.isfinite(codes.style).all()


def test_a_static_object_behind_the_camera_is_not_visible(networks):
    away = look_at((0.0, -9.0, 1.0), (0.0, -20.0, 1.0), 64, 48)
    codes = networks.encode(
        torch.rand(1, 3, 48, 64), Cameras.stack([away]), torch.full((1, 2, 4), NAN)
    )
    assert codes["ground"].visible.tolist() == [False]
    assert torch.isfinite(codes["ground"].style).all()


def test_no_frames_give_no_codes(networks):
    images, cameras, boxes = seen()
    none = Cameras(64, 48, cameras.intrinsics[:0], cameras.world_from_camera[:0])
    codes = networks.encode(images[:0], none, boxes[:0])
    assert {name: len(each.style) for name, each in codes.items()} == dict.fromkeys(codes, 0)
    assert codes["player_1"].heading.shape == (0,)


def test_headings_of_static_objects_and_of_the_compact_design_are_refused():
    with pytest.raises(ConfigError, match="playable objects only"):
        ObjectClassConfig(heading=TURN)
    with pytest.raises(ConfigError, match='"residual" or "attentive"'):
        ObjectClassConfig(kind="playable", heading=EncoderConfig())
