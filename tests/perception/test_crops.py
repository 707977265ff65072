from dataclasses import replace

import pytest
import torch
from small_world import HEIGHT, PLAYER, WIDTH, camera

from pe_runtime.geometry.boxes import box_in_image, visible_box_in_image
from pe_runtime.geometry.cameras import Cameras
from pe_runtime.perception.crops import crop_boxes, cut_out

PLACES = torch.tensor([[0.3, 0.1, 0.0], [-0.5, -9.0, 0.0]])
BOXES = torch.tensor([[10.0, 3.0, 14.0, 12.0], [1.0, 2.0, 3.0, 4.0]])


def regions(crop):
    config = replace(PLAYER, encoder=replace(PLAYER.encoder, crop=crop))
    return crop_boxes(config, Cameras.stack([camera()] * 2), BOXES, PLACES)


def test_a_frame_crop_is_the_whole_picture():
    assert regions("frame").tolist() == [[0, 0, WIDTH, HEIGHT]] * 2


def test_a_box_crop_is_the_box():
    assert torch.equal(regions("box"), BOXES)


def test_a_volume_crop_is_the_projected_volume_and_nan_behind_the_camera():
    wanted, ahead = box_in_image(
        Cameras.stack([camera()] * 2), PLACES, torch.tensor(PLAYER.low), torch.tensor(PLAYER.high)
    )
    assert ahead.tolist() == [True, False]
    torch.testing.assert_close(regions("volume")[0], wanted[0].float())
    assert torch.isnan(regions("volume")[1]).all()


def picture(frames=1, height=6, width=8):
    generator = torch.Generator().manual_seed(0)
    return torch.rand(frames, 3, height, width, generator=generator)


def test_cutting_out_the_whole_picture_at_its_own_size_gives_the_picture():
    images = picture()
    whole = torch.tensor([[0.0, 0.0, 8.0, 6.0]])
    torch.testing.assert_close(cut_out(images, whole, 6, 8), images)


def test_cutting_out_whole_pixels_gives_those_pixels():
    images = picture(2)
    boxes = torch.tensor([[2.0, 1.0, 6.0, 4.0], [0.0, 3.0, 4.0, 6.0]])
    pieces = cut_out(images, boxes, 3, 4)
    torch.testing.assert_close(pieces[0], images[0, :, 1:4, 2:6], atol=1e-6, rtol=0)
    torch.testing.assert_close(pieces[1], images[1, :, 3:6, 0:4], atol=1e-6, rtol=0)


def test_half_resolution_averages_pairs_of_pixels():
    images = picture()
    halved = cut_out(images, torch.tensor([[0.0, 0.0, 8.0, 6.0]]), 3, 4)
    torch.testing.assert_close(halved, torch.nn.functional.avg_pool2d(images, 2))


def test_outside_the_picture_is_black():
    piece = cut_out(picture() + 1, torch.tensor([[20.0, 20.0, 24.0, 23.0]]), 3, 4)
    assert not piece.any()


def test_a_visible_volume_crop_is_clipped_to_the_picture_and_nan_behind_the_camera():
    size = torch.tensor(PLAYER.low), torch.tensor(PLAYER.high)
    places = torch.tensor([[2.2, 0.1, 0.0], [-0.5, -9.0, 0.0]])
    cameras = Cameras.stack([camera()] * 2)
    wanted, ahead = visible_box_in_image(cameras, places, *size)
    assert ahead.tolist() == [True, False]
    config = replace(PLAYER, encoder=replace(PLAYER.encoder, crop="visible-volume"))
    found = crop_boxes(config, cameras, BOXES, places)
    torch.testing.assert_close(found[0], wanted[0].float())
    assert found[0, 2] == WIDTH
    assert torch.isnan(found[1]).all()


@pytest.mark.parametrize("crop", ["volume", "visible-volume"])
def test_a_turned_object_s_volume_is_turned(crop):
    config = replace(PLAYER, low=(-0.6, -0.1, 0.0), high=(0.6, 0.1, 1.7))
    config = replace(config, encoder=replace(PLAYER.encoder, crop=crop))
    cameras = Cameras.stack([camera(azimuth=0.0)] * 2)
    headings = torch.tensor([0.0, torch.pi / 2])
    region = crop_boxes(config, cameras, BOXES, torch.zeros(2, 3), headings)
    across = region[:, 2] - region[:, 0]
    assert across[0] > 3 * across[1]


def widened(box, shares=(2.0, 0.5), crop="box"):
    encoder = replace(PLAYER.encoder, crop=crop, widen=shares)
    views = Cameras.stack([camera(width=400, rows=300)])
    return crop_boxes(
        replace(PLAYER, encoder=encoder), views, torch.tensor([box]), torch.zeros(1, 3)
    )[0].tolist()


def test_a_widened_box_grows_to_both_sides_and_upwards_but_not_below_its_feet():
    assert widened((100.0, 150.0, 120.0, 200.0)) == [60.0, 125.0, 160.0, 200.0]


def test_a_widened_box_ends_with_the_picture():
    assert widened((10.0, 5.0, 60.0, 350.0)) == [0.0, 0.0, 160.0, 300.0]
    assert widened((350.0, 5.0, 390.0, 50.0)) == [270.0, 0.0, 400.0, 50.0]


def test_a_box_that_is_not_widened_may_leave_the_picture():
    assert widened((-7.0, -5.0, 60.0, 350.0), (0.0, 0.0)) == [-7.0, -5.0, 60.0, 350.0]


@pytest.mark.parametrize(
    "box",
    [
        (-30.0, 5.0, -1.0, 50.0),
        (400.0, 5.0, 430.0, 50.0),
        (10.0, -50.0, 20.0, 0.0),
        (10.0, 300.0, 20.0, 340.0),
        (float("nan"),) * 4,
    ],
    ids=["left", "right", "above", "below", "absent"],
)
def test_a_box_of_which_the_picture_shows_nothing_gives_no_region(box):
    assert torch.isnan(torch.tensor(widened(box))).all()


def test_pixels_can_be_resampled_by_their_maximum():
    images = picture()
    pooled = cut_out(images, torch.tensor([[0.0, 0.0, 7.0, 5.0]]), 3, 4, "max")
    torch.testing.assert_close(pooled, torch.nn.functional.max_pool2d(images, 2))
