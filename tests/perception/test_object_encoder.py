from dataclasses import replace

import pytest
import torch
from small_world import GROUND, HEIGHT, PLAYER, WIDTH, camera, shake

from pe_runtime.geometry.boxes import box_in_image
from pe_runtime.geometry.cameras import Cameras
from pe_runtime.perception.object_encoder import (
    VIEW_FEATURES,
    ObjectEncoder,
    crop_boxes,
    cut_out,
    view_features,
)


def encoder(config=PLAYER, seed=0, **changes):
    torch.manual_seed(seed)
    module = ObjectEncoder(replace(config, encoder=replace(config.encoder, **changes)))
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


def test_view_features_say_direction_and_size():
    view = camera(azimuth=0.5)
    places = torch.tensor([[0.3, 0.1, 0.0]])
    region = torch.tensor([[8.0, 4.0, 16.0, 12.0]])
    features = view_features(Cameras.stack([view]), places, region)[0]
    away = places[0] - torch.from_numpy(view.world_from_camera[:3, 3].copy()).float()
    torch.testing.assert_close(features[:3], away / away.norm(), atol=1e-6, rtol=0)
    assert features[3:].tolist() == pytest.approx([8 / WIDTH, 8 / HEIGHT, 12 / WIDTH - 0.5])
