from dataclasses import replace

import numpy as np
import pytest
import torch
from small_world import (
    HEIGHT,
    WIDTH,
    box_of,
    camera,
    look_at,
    picture_of,
    random_codes,
    small_clips,
    small_config,
    small_networks,
)

from pe_runtime.frame_renderer import FrameRenderer
from pe_runtime.geometry.cameras import Cameras, ray_directions
from pe_runtime.networks import SynthesisNetworks
from pe_runtime.rendering import frame_drawing
from pe_runtime.rendering.sampling import grid_pixels
from pe_runtime.rendering.scene import RenderSettings

SETTINGS = RenderSettings(bucket=16)
PLACES = [(-0.7, 0.1, 0.0), (0.8, -0.2, 0.0)]
NAN = float("nan")


@pytest.fixture(scope="module")
def networks():
    return small_networks()


@pytest.fixture(scope="module", autouse=True)
def without_gradients():
    with torch.no_grad():
        yield


def seen(views=None, places=PLACES):
    views = views or [camera(0.2), camera(-0.3)]
    pictures = [picture_of(places, v, [0.9, 0.1][: len(places)]) for v in views]
    boxes = np.array([[box_of(p, v) for p in places] for v in views], dtype=np.float32)
    return (
        torch.from_numpy(np.stack(pictures)).permute(0, 3, 1, 2),
        Cameras.stack(views),
        torch.from_numpy(boxes.reshape(len(views), len(places), 4)),
    )


def frame_of(networks, view, codes=None, settings=SETTINGS):
    codes = random_codes(networks.config) if codes is None else codes
    return FrameRenderer(networks).draw(Cameras.stack([view]), codes, settings)


def geometry_of(networks, view, codes=None):
    codes = random_codes(networks.config) if codes is None else codes
    seen = FrameRenderer(networks).geometry(Cameras.stack([view]), codes, SETTINGS)
    return seen.depth, seen.masks


def with_visible(codes, name, *visible):
    return {**codes, name: replace(codes[name], visible=torch.tensor(visible))}


def test_every_object_gets_codes_of_its_class_s_lengths_in_the_configured_order(networks):
    codes = networks.encode(*seen())
    assert list(codes) == [each.name for each in networks.config.objects]
    for name, each in codes.items():
        config = networks.config.class_of(name)
        assert each.style.shape == (2, config.style_features)
        assert each.pose.shape == (2, config.pose_features)
        assert each.visible.all()


def test_players_stand_at_their_feet_and_statics_where_the_configuration_says(networks):
    codes = networks.encode(*seen())
    assert codes["backdrop"].position.tolist() == [[0.0, 4.0, 0.0]] * 2
    offset = networks.config.classes["player"].foot_offset
    for name, place in zip(networks.config.playable_names, PLACES, strict=True):
        error = (codes[name].position - torch.tensor(place)).norm(dim=-1)
        torch.testing.assert_close(error, torch.full((2,), offset), atol=0.05, rtol=0)


def test_swapping_the_boxes_swaps_the_players_because_they_share_their_networks(networks):
    images, cameras, boxes = seen()
    straight = networks.encode(images, cameras, boxes)
    turned = networks.encode(images, cameras, boxes.flip(1))
    for one, other in (("player_1", "player_2"), ("player_2", "player_1")):
        torch.testing.assert_close(straight[one].style, turned[other].style)
        torch.testing.assert_close(straight[one].pose, turned[other].pose)
        torch.testing.assert_close(straight[one].position, turned[other].position)


@pytest.mark.parametrize(
    "box",
    [(NAN,) * 4, (5.0, 4.0, 5.0, 9.0), (5.0, -9.0, 8.0, -3.0)],
    ids=["absent", "without area", "above the horizon"],
)
def test_a_player_without_a_usable_box_is_invisible_in_that_frame_only(networks, box):
    images, cameras, boxes = seen()
    wanted = networks.encode(images, cameras, boxes)
    boxes[1, 0] = torch.tensor(box)
    codes = networks.encode(images, cameras, boxes)
    assert codes["player_1"].visible.tolist() == [True, False]
    assert codes["player_2"].visible.all()
    assert all(torch.isfinite(each.style).all() for each in codes.values())
    assert torch.equal(codes["player_2"].style, wanted["player_2"].style)


def test_a_player_whose_volume_reaches_behind_the_camera_is_invisible(networks):
    close = look_at((0.0, -1.0, 0.6), (0.0, 0.0, 0.3))
    images, cameras, boxes = seen([close], [(0.0, -0.7, 0.0), (0.5, 3.0, 0.0)])
    codes = networks.encode(images, cameras, boxes)
    assert codes["player_1"].visible.tolist() == [False]
    assert codes["player_2"].visible.tolist() == [True]


def test_zero_players_encode_and_render():
    networks = small_networks(small_config(players=0))
    codes = networks.encode(*seen(places=[]))
    assert list(codes) == ["ground", "backdrop", "sky"]
    first = {name: replace_rows(each) for name, each in codes.items()}
    picture, _ = frame_of(networks, camera(), first)
    assert torch.isfinite(picture).all()


def replace_rows(codes, frame=0):
    present = {k: v for k, v in vars(codes).items() if v is not None}
    return replace(codes, **{k: v[frame : frame + 1] for k, v in present.items()})


def test_a_whole_frame_equals_the_training_path_with_the_full_window(networks):
    views = [camera(0.2), camera(-0.3, distance=4.0)]
    codes = random_codes(networks.config, frames=2)
    windows = torch.zeros(2, 2, dtype=torch.long)
    trained = networks.synthesise(Cameras.stack(views), codes, windows, (HEIGHT, WIDTH), SETTINGS)
    for frame, view in enumerate(views):
        own = {name: replace_rows(each, frame) for name, each in codes.items()}
        picture, _ = frame_of(networks, view, own)
        torch.testing.assert_close(picture, trained[frame], atol=1e-5, rtol=0)


def test_a_window_shows_what_the_whole_frame_shows_there():
    torch.manual_seed(0)
    # A fresh F adds nothing of its own, so only the interpolation knows the window's rim.
    networks = SynthesisNetworks(small_config()).eval()
    codes = random_codes(networks.config)
    cameras = Cameras.stack([camera()])
    whole = networks.synthesise(cameras, codes, torch.tensor([[0, 0]]), (HEIGHT, WIDTH), SETTINGS)
    part = networks.synthesise(cameras, codes, torch.tensor([[4, 12]]), (8, 12), SETTINGS)
    inner = (..., slice(1, -1), slice(1, -1))
    torch.testing.assert_close(part[inner], whole[..., 4:12, 12:24][inner], atol=1e-5, rtol=0)


@pytest.mark.parametrize("chunk", [1, 7, 64])
def test_chunks_change_no_bit(networks, chunk, monkeypatch):
    view = camera(width=12, rows=8)
    whole, counted = frame_of(networks, view)
    depth, masks = geometry_of(networks, view)
    monkeypatch.setattr(frame_drawing, "KEPT_RAYS", 0)
    monkeypatch.setattr(frame_drawing, "CHUNK", chunk)
    chunked, counted_in_chunks = frame_of(networks, view)
    assert torch.equal(chunked, whole)
    assert counted_in_chunks["rays"] == counted["rays"]
    assert counted_in_chunks["field_samples"] == counted["field_samples"]
    chunked_depth, chunked_masks = geometry_of(networks, view)
    assert torch.equal(chunked_depth, depth)
    for name, mask in masks.items():
        assert torch.equal(chunked_masks[name], mask)


@pytest.mark.parametrize("bucket", [1, 16, 1024])
def test_padding_buckets_change_nothing(networks, bucket):
    wanted, _ = frame_of(networks, camera())
    found, _ = frame_of(networks, camera(), settings=replace(SETTINGS, bucket=bucket))
    torch.testing.assert_close(found, wanted, atol=1e-5, rtol=0)


@pytest.mark.parametrize("size", [(33, 17), (30, 18), (9, 31), (5, 5), (3, 2), (1, 1)])
def test_frames_of_any_size_are_drawn(networks, size):
    width, height = size
    view = camera(width=width, rows=height)
    picture, _ = frame_of(networks, view)
    assert picture.shape == (3, height, width)
    assert torch.isfinite(picture).all()
    depth, masks = geometry_of(networks, view)
    assert depth.shape == (height, width)
    assert {each.shape for each in masks.values()} == {(height, width)}


def test_the_pixels_of_an_odd_size_are_those_of_the_larger_even_one(networks):
    view = camera(width=32, rows=16)
    cropped = replace(view, width=29, height=13)
    whole, _ = frame_of(networks, view)
    part, _ = frame_of(networks, cropped)
    torch.testing.assert_close(part, whole[:, :13, :29], atol=1e-5, rtol=0)


def test_a_hidden_player_costs_no_samples(networks):
    codes = random_codes(networks.config)
    hidden = with_visible(codes, "player_2", False)
    removed = {name: each for name, each in codes.items() if name != "player_2"}
    pictures, counts = zip(
        *(frame_of(networks, camera(), each) for each in (hidden, removed)), strict=True
    )
    assert counts[0] == counts[1]
    assert torch.equal(*pictures)
    assert frame_of(networks, camera(), codes)[1]["field_samples"] > counts[0]["field_samples"]


@pytest.mark.parametrize("place", [(0.0, -20.0, 0.0), (30.0, 0.0, 0.0)])
def test_a_player_out_of_view_costs_no_samples(networks, place):
    codes = random_codes(networks.config, places=(PLACES[0], place))
    removed = {name: each for name, each in codes.items() if name != "player_2"}
    picture, counted = frame_of(networks, camera(), codes)
    wanted, counted_without = frame_of(networks, camera(), removed)
    assert counted == counted_without
    assert torch.equal(picture, wanted)


def test_an_empty_world_is_a_picture_too(networks):
    picture, counted = frame_of(networks, camera(), {})
    assert picture.shape == (3, HEIGHT, WIDTH)
    assert torch.isfinite(picture).all()
    assert counted["field_samples"] == 0
    depth, masks = geometry_of(networks, camera(), {})
    assert torch.isinf(depth).all() and masks == {}


def test_masks_of_an_opaque_world_sum_to_one(networks):
    _, masks = geometry_of(networks, camera())
    assert list(masks) == [each.name for each in networks.config.objects]
    total = sum(masks.values())
    torch.testing.assert_close(total, torch.ones_like(total), atol=1e-5, rtol=0)
    assert all((0 <= m).all() and (m <= 1 + 1e-6).all() for m in masks.values())
    assert masks["player_1"].max() > 0.05


def test_a_hidden_player_has_no_mask(networks):
    codes = with_visible(random_codes(networks.config), "player_1", False)
    _, masks = geometry_of(networks, camera(), codes)
    assert list(masks) == ["ground", "backdrop", "sky", "player_2"]


def test_the_depth_of_the_ground_is_that_of_its_plane(networks):
    view = look_at((0.3, -3.0, 2.0), (0.0, 0.0, 0.0))
    ground = {"ground": random_codes(networks.config)["ground"]}
    depth, masks = geometry_of(networks, view, ground)
    cameras, pixels = Cameras.stack([view]), grid_pixels(0, 0, HEIGHT, WIDTH, 1)
    directions = ray_directions(cameras, torch.zeros(len(pixels), dtype=torch.long), pixels)
    top = networks.config.classes["ground"].high[2]
    plane = (top - view.world_from_camera[2, 3]) / directions[:, 2]
    inside = (masks["ground"] > 0.5).flatten()
    assert inside.float().mean() > 0.5
    torch.testing.assert_close(depth.flatten()[inside], plane.float()[inside], atol=1e-4, rtol=1e-5)
    assert torch.isinf(depth.flatten()[~inside]).all()


def test_the_sky_is_infinitely_far(networks):
    up = look_at((0.0, -3.0, 1.0), (0.0, 0.0, 6.0))
    depth, masks = geometry_of(networks, up)
    assert torch.isinf(depth).all()
    torch.testing.assert_close(masks["sky"], torch.ones(HEIGHT, WIDTH))


def test_the_style_of_the_ground_changes_its_pixels_and_no_geometry(networks):
    codes = random_codes(networks.config)
    restyled = {**codes, "ground": replace(codes["ground"], style=codes["ground"].style + 2)}
    before, after = (frame_of(networks, camera(), each)[0] for each in (codes, restyled))
    assert not torch.allclose(before, after)
    (depth, masks), (other_depth, other_masks) = (
        geometry_of(networks, camera(), each) for each in (codes, restyled)
    )
    assert torch.equal(depth, other_depth)
    assert all(torch.equal(masks[name], other_masks[name]) for name in masks)


def test_absent_players_stay_out_of_batch_statistics():
    config = small_config(width=40, height=24)
    clips = small_clips()
    networks = small_networks(config).train()
    times = torch.arange(4)
    batch = clips.batch(torch.zeros(4, dtype=torch.long), times)
    absent = batch.boxes.clone()
    absent[2:, 1] = torch.nan
    with torch.no_grad():
        codes = networks.encode(batch.images, batch.cameras, absent)
        # The others are what they are where nobody else is in the batch.
        seen = torch.cat([codes["player_1"].pose, codes["player_2"].pose[:2]])
    torch.testing.assert_close(seen.mean(0), torch.zeros(3), atol=1e-5, rtol=0)
    assert codes["player_2"].visible.tolist() == [True, True, False, False]
    assert (codes["player_2"].pose[2:] == 0).all()
