"""PSNR, SSIM and box masks against hand numbers and a slow twin."""

import math

import numpy as np
import pytest

from pe_runtime.evaluation.visual import box_mask, psnr, ssim


def noise(seed, height=20, width=24):
    return np.random.default_rng(seed).random((height, width, 3)).astype(np.float32)


def test_an_error_of_a_tenth_everywhere_is_twenty_decibels():
    reference = np.full((4, 5, 3), 0.5, dtype=np.float32)
    assert psnr(reference + np.float32(0.1), reference) == pytest.approx(20.0, abs=1e-5)


def test_equal_pictures_have_a_finite_psnr():
    assert psnr(noise(0), noise(0)) == pytest.approx(100.0)


def test_psnr_counts_only_the_masked_pixels():
    reference, picture = noise(0), noise(0)
    picture[:10] += 0.1
    mask = np.zeros(reference.shape[:2], dtype=bool)
    mask[10:] = True
    assert psnr(picture, reference, mask) == pytest.approx(100.0)
    assert psnr(picture, reference, ~mask) == pytest.approx(20.0, abs=1e-4)


def test_psnr_of_no_pixels_cannot_be_told():
    assert math.isnan(psnr(noise(0), noise(1), np.zeros((20, 24), dtype=bool)))


def test_ssim_of_equal_pictures_is_one_and_of_unrelated_noise_near_zero():
    assert ssim(noise(0), noise(0)) == pytest.approx(1.0)
    assert abs(ssim(noise(0), noise(1))) < 0.1


def test_ssim_agrees_with_a_loop_over_windows():
    picture, reference = noise(2, 14, 13), noise(3, 14, 13)
    assert ssim(picture, reference) == pytest.approx(ssim_by_loops(picture, reference), abs=1e-9)


def ssim_by_loops(picture, reference):
    steps = np.arange(-5, 6)
    window = np.exp(-(steps[:, None] ** 2 + steps[None] ** 2) / (2 * 1.5**2))
    window /= window.sum()
    values = []
    for channel in range(3):
        for top in range(picture.shape[0] - 10):
            for left in range(picture.shape[1] - 10):
                x = picture[top : top + 11, left : left + 11, channel].astype(float)
                y = reference[top : top + 11, left : left + 11, channel].astype(float)
                mean_x, mean_y = (window * x).sum(), (window * y).sum()
                spread_x = (window * (x - mean_x) ** 2).sum()
                spread_y = (window * (y - mean_y) ** 2).sum()
                shared = (window * (x - mean_x) * (y - mean_y)).sum()
                top_part = (2 * mean_x * mean_y + 1e-4) * (2 * shared + 9e-4)
                bottom = (mean_x**2 + mean_y**2 + 1e-4) * (spread_x + spread_y + 9e-4)
                values.append(top_part / bottom)
    return np.mean(values)


def test_ssim_of_a_picture_smaller_than_its_window_cannot_be_told():
    assert math.isnan(ssim(noise(0, 10, 24), noise(1, 10, 24)))


def test_a_box_covers_the_pixels_whose_centres_it_holds():
    mask = box_mask([(1.5, 0.6, 3.5, 2.5)], 4, 5)
    assert np.argwhere(mask).tolist() == [[1, 1], [1, 2]]


def test_boxes_are_joined_and_clipped_to_the_picture():
    mask = box_mask([(-10.0, -10.0, 1.0, 1.0), (4.0, 3.0, 99.0, 99.0)], 4, 5)
    assert np.argwhere(mask).tolist() == [[0, 0], [3, 4]]


def test_boxes_of_absent_players_and_of_zero_area_cover_nothing():
    nan = float("nan")
    assert not box_mask([(nan, nan, nan, nan), (2.0, 2.0, 2.0, 4.0)], 4, 5).any()
    assert not box_mask([], 4, 5).any()
