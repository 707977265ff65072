"""From the worker's bytes to the numbers of Blender's passes; no Blender needed."""

import numpy as np
import pytest

from blender_addon.filming.pixels import FAR_AWAY, PassMemory, memory_for


def linear(encoded):
    """The sRGB curve, number by number in float64."""
    low, high = encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4
    return np.float32(low if encoded <= 0.04045 else high)


def naive_combined(rgb):
    """Row after row from the bottom up, one number after the other."""
    numbers = []
    for row in reversed(rgb.tolist()):
        for pixel in row:
            numbers += [*(linear(byte / 255) for byte in pixel), np.float32(1)]
    return np.array(numbers, np.float32)


def naive_layer(rgba):
    """The same of straight alpha, multiplied by it."""
    numbers = []
    for row in reversed(rgba.tolist()):
        for *colour, alpha in row:
            share = np.float32(alpha) / np.float32(255)
            numbers += [*(linear(byte / 255) * share for byte in colour), share]
    return np.array(numbers, np.float32)


def random_bytes(shape):
    values = np.random.default_rng(0).permutation(np.arange(np.prod(shape)) % 256)
    assert set(values.tolist()) == set(range(256))
    return values.reshape(shape).astype(np.uint8)


@pytest.mark.parametrize("size", [(32, 9), (11, 31), (1, 256)])
def test_every_byte_becomes_the_very_number_of_the_srgb_curve(size):
    rgb = random_bytes((*size, 3))
    numbers = PassMemory(size[1], size[0]).combined(rgb)
    assert numbers.dtype == np.float32 and numbers.flags.c_contiguous and numbers.ndim == 1
    assert numbers.tobytes() == naive_combined(rgb).tobytes()


def test_a_single_pixel_has_numbers_too():
    one = np.array([[[255, 0, 188]]], np.uint8)
    assert PassMemory(1, 1).combined(one).tobytes() == naive_combined(one).tobytes()


def test_layers_are_multiplied_by_their_alpha_and_leave_the_picture_opaque():
    rgba = random_bytes((16, 17, 4))
    rgba[0, 0] = 200, 100, 50, 0
    memory = PassMemory(17, 16)
    assert memory.layer(rgba).tobytes() == naive_layer(rgba).tobytes()
    assert (memory.layer(rgba).reshape(16, 17, 4)[-1, 0] == 0).all()
    rgb = random_bytes((16, 17, 3))
    assert memory.combined(rgb).tobytes() == naive_combined(rgb).tobytes()


def test_depth_is_scaled_and_nothing_is_far_away_and_masks_are_unchanged():
    depth = np.array([[1.5, np.inf, 3.0], [0.25, 7.0, np.inf]], "<f4")
    memory = PassMemory(3, 2)
    assert memory.depth(depth, 2.0).tolist() == [0.5, 14.0, FAR_AWAY, 3.0, FAR_AWAY, 6.0]
    assert np.isinf(depth).sum() == 2
    assert memory.values(depth).tolist() == [0.25, 7.0, np.inf, 1.5, np.inf, 3.0]


def test_memory_is_kept_from_frame_to_frame_and_leaves_nothing_of_the_last_one():
    memory = memory_for(4, 2)
    assert memory_for(4, 2) is memory
    first = memory.combined(np.full((2, 4, 3), 255, np.uint8))
    assert (first == 1).all()
    memory.values(np.full((2, 4), 9, np.float32))
    again = memory.combined(np.zeros((2, 4, 3), np.uint8))
    assert again.reshape(8, 4).tolist() == [[0, 0, 0, 1]] * 8
    assert np.shares_memory(first, again)
