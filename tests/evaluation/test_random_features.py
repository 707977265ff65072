"""The stand-ins: what they see, what they do not, and that they are the same everywhere."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from pe_runtime.evaluation.frechet import frechet_distance
from pe_runtime.evaluation.random_features import KEPT, RandomFilters, RandomPerception


@pytest.fixture(scope="module")
def perception():
    return RandomPerception()


def scene(seed=0, size=(32, 48), shift=0):
    rng = np.random.default_rng(seed)
    picture = gaussian_filter(rng.random((*size, 3)), (2, 2, 0))
    picture = (picture - picture.min()) / (picture.max() - picture.min())
    return np.roll(picture, shift, axis=1).astype(np.float32)


def test_equal_pictures_are_at_no_distance_and_blurred_ones_farther_the_more_they_are_blurred(
    perception,
):
    picture = scene()
    blurred = [gaussian_filter(picture, (s, s, 0)) for s in (0.5, 1.0, 2.0)]
    distances = [perception.distance(each, picture) for each in (picture, *blurred)]
    assert distances[0] == pytest.approx(0, abs=1e-9)
    assert distances == sorted(distances)
    assert distances[1] > 1e-4


def test_the_distance_does_not_depend_on_the_order(perception):
    a, b = scene(0), scene(1)
    assert perception.distance(a, b) == pytest.approx(perception.distance(b, a))
    assert 0 < perception.distance(a, b) < 2


def test_faint_noise_on_a_flat_picture_is_no_texture(perception):
    flat = np.full((32, 48, 3), 0.5, np.float32)
    noise = np.random.default_rng(0).normal(0, 1e-3, flat.shape).astype(np.float32)
    assert perception.distance(flat + noise, flat) < 0.02


def test_the_filters_are_the_same_on_every_machine_and_answer_to_structure_alone():
    filters = RandomFilters()
    assert float(filters.filters[0][0, 0, 0, 0]) == pytest.approx(-0.0598088, abs=1e-6)
    assert float(filters.projection[0, 0]) == pytest.approx(0.0032141, abs=1e-6)
    assert max(float(each.mean(dim=(2, 3)).abs().max()) for each in filters.filters) < 1e-6
    assert not any(each.requires_grad for each in filters.parameters())


def test_frames_of_the_same_kind_are_closer_than_frames_of_another(perception):
    sharp = np.stack([scene(seed) for seed in range(24)])
    again = np.stack([scene(seed) for seed in range(24, 48)])
    soft = np.stack([gaussian_filter(each, (1.5, 1.5, 0)) for each in again])
    features = [perception.of_frames(each) for each in (sharp, again, soft)]
    assert features[0].shape == (24, KEPT)
    assert frechet_distance(*features[:2]) < 0.5 * frechet_distance(features[0], features[2])


def clip(seed, shifts):
    return np.stack([scene(seed, shift=shift) for shift in shifts])


def test_clips_see_movement_that_single_frames_do_not(perception):
    moving = [clip(seed, (0, 3, 6, 9)) for seed in range(12)]
    # The same frames in an order without a direction of their own look alike one by one.
    still = [clip(seed, (0, 0, 9, 9)) for seed in range(12)]
    of_clips = [
        np.concatenate([perception.of_clips(c, 4) for c in each]) for each in (moving, still)
    ]
    half = KEPT // 2
    seen_still = frechet_distance(*(each[:, :half] for each in of_clips))
    seen_moving = frechet_distance(*(each[:, half:] for each in of_clips))
    assert of_clips[0].shape == (12, KEPT)
    assert seen_moving > 5 * seen_still


def test_what_does_not_fill_a_clip_is_left_out(perception):
    frames = clip(0, range(11))
    assert perception.of_clips(frames, 4).shape == (2, KEPT)
    assert perception.of_clips(frames[:3], 4).shape == (0, KEPT)
