import math

import pytest
import torch

from pe_runtime.field.layers import Modulation, PositionalEncoding, per_ray, stack


def naive_encoding(point, octaves, base):
    """(p, all sines, all cosines), octave by octave, each over the coordinates."""
    angles = [base * 2**k * p for k in range(octaves) for p in point]
    return [*point, *[math.sin(a) for a in angles], *[math.cos(a) for a in angles]]


@pytest.mark.parametrize(("dimensions", "octaves"), [(1, 1), (2, 3), (3, 6), (3, 0)])
@pytest.mark.parametrize("shape", [(), (1,), (3, 1, 2)])
def test_positional_encoding_agrees_with_its_formula(dimensions, octaves, shape):
    encoding = PositionalEncoding(dimensions, octaves, 1.5).double()
    points = torch.rand(*shape, dimensions, dtype=torch.float64) * 2 - 1
    encoded = encoding(points)
    assert encoded.shape == (*shape, encoding.features)
    for point, row in zip(
        points.reshape(-1, dimensions).tolist(),
        encoded.reshape(-1, encoding.features).tolist(),
        strict=True,
    ):
        assert row == pytest.approx(naive_encoding(point, octaves, 1.5), abs=1e-12)


def test_positional_encoding_of_the_origin_by_hand():
    encoded = PositionalEncoding(2, 2, 1.0)(torch.zeros(2))
    assert encoded.tolist() == [0, 0, 0, 0, 0, 0, 1, 1, 1, 1]


def test_half_precision_points_are_still_encoded_with_float32_angles():
    encoding = PositionalEncoding(1, 9, math.pi / 2)
    with torch.autocast("cpu", torch.bfloat16):
        encoded = encoding(torch.tensor([[0.73]]))
    assert encoded.dtype == torch.float32


def test_a_fresh_modulation_starts_as_an_almost_plain_scale_of_one():
    torch.manual_seed(0)
    scale, shift = Modulation(4, 6)(torch.zeros(2, 4))
    assert torch.equal(scale, torch.ones(2, 6))
    assert torch.equal(shift, torch.zeros(2, 6))


def test_modulation_is_linear_in_the_style():
    torch.manual_seed(0)
    modulation = Modulation(4, 6).double()
    a, b = torch.randn(2, 1, 4, dtype=torch.float64)
    mixed = modulation(0.3 * a + 0.7 * b)
    for m, x, y in zip(mixed, modulation(a), modulation(b), strict=True):
        torch.testing.assert_close(m, 0.3 * x + 0.7 * y)


def test_every_ray_gets_its_own_frame_s_row():
    values = torch.arange(6.0).reshape(3, 2)
    frame = torch.tensor([2, 0, 0, 1])
    assert per_ray(values, frame).tolist() == [[[4, 5]], [[0, 1]], [[0, 1]], [[2, 3]]]


def test_a_single_frame_is_shared_by_all_rays_without_a_copy():
    values = torch.tensor([[1.0, 2.0]])
    shared = per_ray(values, torch.zeros(1000, dtype=torch.long))
    assert shared.shape == (1000, 1, 2)
    assert shared.data_ptr() == values.data_ptr()


def test_a_stack_has_one_layer_between_successive_widths():
    layers = stack([3, 8, 5])
    assert [(each.in_features, each.out_features) for each in layers] == [(3, 8), (8, 5)]
    assert all(not each.bias.any() for each in layers)
