"""Noise on annotations: as much as asked for, of the kind asked for, and nothing else."""

from dataclasses import replace

import numpy as np
import pytest
from small_dataset import HEIGHT, WIDTH, arrays

from pe_runtime.contract.errors import EpisodeError
from pe_runtime.curation.noise import LONGEST_ABSENCE, Noise, disturbed

SIZE = (WIDTH, HEIGHT)
NONE = Noise(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
LONG = 4000


def noisy(noise, frames=12, views=1, seed=(1, 2)):
    true = arrays(views, frames)
    return true, disturbed(true, noise, SIZE, seed)


def turns(true, found):
    """Angles in degrees between true and found cameras of the first view."""
    between = (
        np.swapaxes(true.world_from_camera[0, :, :3, :3], -1, -2)
        @ (found.world_from_camera[0, :, :3, :3])
    )
    sine = np.stack(
        [
            between[:, 2, 1] - between[:, 1, 2],
            between[:, 0, 2] - between[:, 2, 0],
            between[:, 1, 0] - between[:, 0, 1],
        ],
        axis=-1,
    )
    return np.degrees(sine / 2)


def test_no_noise_changes_nothing():
    true, found = noisy(NONE, views=2)
    for name in ("intrinsics", "world_from_camera", "boxes", "present", "positions", "actions"):
        np.testing.assert_array_equal(getattr(found, name), getattr(true, name))


def test_camera_errors_are_as_large_as_asked_for():
    true, found = noisy(Noise(camera_degrees=0.5, camera_metres=0.1, focal=0.02), LONG)
    assert turns(true, found).std(0) == pytest.approx(0.5, rel=0.15)
    off = found.world_from_camera[0, :, :3, 3] - true.world_from_camera[0, :, :3, 3]
    assert off.std(0) == pytest.approx(0.1, rel=0.15)
    share = np.log(found.intrinsics[0, :, 0, 0] / true.intrinsics[0, :, 0, 0])
    assert share.std() == pytest.approx(0.02, rel=0.15)


def test_noisy_cameras_are_still_rigid_with_square_pixels_and_the_same_centre():
    true, found = noisy(Noise(camera_degrees=20.0, focal=0.1), 50)
    rotation = found.world_from_camera[0, :, :3, :3]
    np.testing.assert_allclose(
        rotation @ np.swapaxes(rotation, -1, -2), np.tile(np.eye(3), (50, 1, 1)), atol=1e-12
    )
    np.testing.assert_allclose(np.linalg.det(rotation), 1.0)
    lens = found.intrinsics[0]
    np.testing.assert_array_equal(lens[:, 0, 0], lens[:, 1, 1])
    np.testing.assert_array_equal(lens[:, :, 2], true.intrinsics[0, :, :, 2])


def test_cameras_drift_rather_than_tremble():
    true, found = noisy(Noise(camera_degrees=0.5), LONG)
    angles = turns(true, found)
    neighbours = np.mean(angles[1:] * angles[:-1]) / np.mean(angles**2)
    assert 0.6 < neighbours < 0.95
    jumps = np.diff(angles, axis=0).std()
    assert 0.1 < jumps < 0.4, "there is a little tremble"


def test_edges_of_boxes_are_off_by_the_pixels_asked_for():
    true, found = noisy(replace(NONE, box_pixels=1.5), LONG)
    both = true.present & found.present
    off = found.boxes[both] - true.boxes[both]
    assert off.std(0) == pytest.approx(1.5, rel=0.1)
    assert abs(off.mean(0)).max() < 0.1


def test_outliers_are_a_few_boxes_that_are_off_by_more():
    true, found = noisy(replace(NONE, outliers=0.1), LONG)
    moved = (found.boxes != true.boxes).any(-1) & true.present
    assert moved.sum() / true.present.sum() == pytest.approx(0.1, abs=0.02)
    off = np.abs(found.boxes - true.boxes)[moved]
    assert 1.0 < off[:, 0].mean() <= 0.35 * 8


def test_dropouts_are_as_common_as_asked_for_and_last_a_few_frames():
    true, found = noisy(replace(NONE, dropout=0.2), LONG)
    lost = true.present & ~found.present
    assert lost.sum() / true.present.sum() == pytest.approx(0.2, abs=0.02)
    assert np.isnan(found.boxes[lost]).all()
    near = lost[0, :, 1]
    borders = np.flatnonzero(np.diff(np.pad(near, 1).astype(int)))
    lengths = borders[1::2] - borders[::2]
    assert 1.5 < lengths.mean() < LONGEST_ABSENCE, "gaps may touch, but most are short"


def test_everything_may_drop_out_and_nothing_absent_appears():
    true, found = noisy(replace(NONE, dropout=1.0))
    assert not found.present.any()
    true, found = noisy(Noise(dropout=0.0))
    np.testing.assert_array_equal(found.present, true.present)


def test_boxes_stay_inside_the_picture_and_keep_a_size():
    _, found = noisy(replace(NONE, box_pixels=30.0), 400)
    seen = found.boxes[found.present]
    assert seen.min() >= 0
    assert seen[:, 2].max() <= WIDTH
    assert seen[:, 3].max() <= HEIGHT
    assert (seen[:, 2:] - seen[:, :2]).min() >= 2.0 - 1e-5


def test_further_views_positions_and_actions_stay_true():
    true, found = noisy(Noise(5.0, 1.0, 0.1, 5.0, 0.5, 0.5), views=2)
    for name in ("intrinsics", "world_from_camera", "boxes", "present"):
        np.testing.assert_array_equal(getattr(found, name)[1], getattr(true, name)[1])
        assert not np.array_equal(getattr(found, name)[0], getattr(true, name)[0])
    np.testing.assert_array_equal(found.positions, true.positions)
    np.testing.assert_array_equal(found.actions, true.actions)


def test_the_seed_decides_the_noise_and_the_true_arrays_are_left_alone():
    true, first = noisy(Noise())
    _, again = noisy(Noise())
    _, other = noisy(Noise(), seed=(1, 3))
    np.testing.assert_array_equal(first.boxes, again.boxes)
    assert not np.array_equal(first.world_from_camera, other.world_from_camera)
    np.testing.assert_array_equal(true.boxes, arrays().boxes)


def test_more_of_one_kind_leaves_the_others_as_they_were():
    _, little = noisy(Noise(dropout=0.0))
    _, much = noisy(Noise(dropout=0.5, camera_metres=1.0))
    np.testing.assert_array_equal(
        little.world_from_camera[..., :3, :3], much.world_from_camera[..., :3, :3]
    )
    np.testing.assert_array_equal(little.boxes[much.present], much.boxes[much.present])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"focal": -0.1}, "focal is -0.1; expected 0 or more"),
        ({"dropout": 1.5}, "dropout is 1.5; expected 0 or more, at most 1"),
        ({"box_pixels": float("nan")}, "box_pixels is nan"),
    ],
)
def test_impossible_amounts_are_refused(change, message):
    with pytest.raises(EpisodeError, match=message):
        Noise(**change)
