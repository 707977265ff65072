"""From the worker's bytes to the numbers of Blender's passes; no Blender needed."""

import numpy as np
import pytest

from blender_addon.pixels import FAR_AWAY, PassMemory, Window, memory_for


def linear(encoded):
    """The sRGB curve, number by number in float64."""
    low, high = encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4
    return np.float32(low if encoded <= 0.04045 else high)


def naive_combined(rgb, window):
    """Row after row from the bottom up, one number after the other."""
    height = rgb.shape[0]
    numbers = []
    for row in range(window.bottom, window.bottom + window.height):
        for pixel in rgb[height - 1 - row, window.left : window.left + window.width]:
            numbers += [*(linear(byte / 255) for byte in pixel.tolist()), np.float32(1)]
    return np.array(numbers, np.float32)


@pytest.mark.parametrize("window", [Window(0, 0, 9, 32), Window(2, 5, 3, 11), Window(8, 31, 1, 1)])
def test_every_byte_becomes_the_very_number_of_the_srgb_curve(window):
    rgb = np.random.default_rng(0).permutation(np.arange(32 * 9 * 3) % 256).reshape(32, 9, 3)
    rgb = rgb.astype(np.uint8)
    assert set(rgb.ravel()) == set(range(256))
    numbers = PassMemory(window).combined(rgb)
    assert numbers.dtype == np.float32 and numbers.flags.c_contiguous and numbers.ndim == 1
    assert numbers.tobytes() == naive_combined(rgb, window).tobytes()


def test_depth_is_scaled_and_nothing_is_far_away_and_masks_are_unchanged():
    depth = np.array([[1.5, np.inf, 3.0], [0.25, 7.0, np.inf]], "<f4")
    memory = PassMemory(Window(0, 0, 3, 2))
    assert memory.depth(depth, 2.0).tolist() == [0.5, 14.0, FAR_AWAY, 3.0, FAR_AWAY, 6.0]
    assert np.isinf(depth).sum() == 2
    assert memory.values(depth).tolist() == [0.25, 7.0, np.inf, 1.5, np.inf, 3.0]
    part = PassMemory(Window(1, 0, 2, 1))
    assert part.values(depth).tolist() == [7.0, np.inf]


def test_memory_is_kept_from_frame_to_frame_and_leaves_nothing_of_the_last_one():
    window = Window(0, 0, 4, 2)
    memory = memory_for(window)
    assert memory_for(Window(0, 0, 4, 2)) is memory
    first = memory.combined(np.full((2, 4, 3), 255, np.uint8))
    assert (first == 1).all()
    memory.values(np.full((2, 4), 9, np.float32))
    again = memory.combined(np.zeros((2, 4, 3), np.uint8))
    assert again.reshape(8, 4).tolist() == [[0, 0, 0, 1]] * 8
    assert np.shares_memory(first, again)
