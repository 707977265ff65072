"""Data sets with smaller pictures."""

import numpy as np
import pytest

from pe_runtime.contract.camera import project
from pe_runtime.contract.episode import read_dataset, read_episode
from pe_runtime.contract.errors import EpisodeError
from pe_runtime.curation.shrinking import shrink_dataset, shrunk_arrays
from pe_runtime.images import read_image
from tests.tiny_model import HEIGHT, WIDTH, write_clip


@pytest.fixture
def small(tmp_path):
    write_clip(tmp_path / "large")
    shrink_dataset(tmp_path / "large", tmp_path / "small", 2)
    return tmp_path


def test_pictures_have_half_the_size_and_the_same_mean(small):
    _, (large,) = read_dataset(small / "large")
    info, (shrunk,) = read_dataset(small / "small")
    assert (info.width, info.height) == (WIDTH // 2, HEIGHT // 2)
    before = read_image(read_episode(large).frame_path(0, 0))
    after = read_image(read_episode(shrunk).frame_path(0, 0))
    assert after.shape == (HEIGHT // 2, WIDTH // 2, 3)
    assert abs(before.mean() - after.mean()) < 1 / 255


def test_a_point_is_seen_at_half_its_pixel_coordinates(small):
    _, (large,) = read_dataset(small / "large")
    _, (shrunk,) = read_dataset(small / "small")
    point = np.array([[0.3, -0.2, 1.1]])
    before, _ = project(read_episode(large).camera(0, 0), point)
    after, _ = project(read_episode(shrunk).camera(0, 0), point)
    np.testing.assert_allclose(after, before / 2, atol=1e-9)


def test_boxes_are_scaled_and_absent_ones_stay_absent(small):
    _, (large,) = read_dataset(small / "large")
    arrays = read_episode(large).arrays
    np.testing.assert_allclose(shrunk_arrays(arrays, 2).boxes, arrays.boxes / 2)
    assert (shrunk_arrays(arrays, 2).present == arrays.present).all()


def test_a_second_run_writes_nothing_anew(small):
    _, (shrunk,) = read_dataset(small / "small")
    before = read_episode(shrunk).frame_path(0, 0).stat().st_mtime_ns
    shrink_dataset(small / "large", small / "small", 2)
    assert read_episode(shrunk).frame_path(0, 0).stat().st_mtime_ns == before


@pytest.mark.parametrize("factor", [1, 0, 3])
def test_a_factor_that_does_not_divide_the_size_is_refused(small, factor):
    with pytest.raises(EpisodeError, match="cannot be shrunk"):
        shrink_dataset(small / "large", small / "other", factor)


def test_a_folder_with_another_data_set_is_refused(small):
    with pytest.raises(EpisodeError, match="another data set"):
        shrink_dataset(small / "large", small / "small", 4)
