"""Inputs of convolutions, against torch's own padding and interpolation of whole maps."""

import pytest
import torch
from torch.nn import functional

from pe_runtime.rendering.gathering import Source, gathered
from pe_runtime.rendering.packed_convolution import packed
from pe_runtime.rendering.regions import Region

SHAPES = [(2, 2), (4, 3), (6, 11)]


def value(shape, channels=3, seed=0):
    generator = torch.Generator().manual_seed(seed)
    return torch.randn(1, channels, *shape, generator=generator)


def regions_of(height, width):
    yield Region(0, 0, height, width)
    yield Region(0, 0, 1, 1)
    yield Region(height - 1, width - 1, height, width)
    yield Region(1, 0, height, width - 1)
    yield Region(height // 2, width // 3, height // 2 + 1, width // 3 + 1)


def cut(padded, region, radius):
    rows = slice(region.top, region.bottom + 2 * radius)
    return padded[..., rows, region.left : region.right + 2 * radius]


@pytest.mark.parametrize("shape", SHAPES, ids=str)
@pytest.mark.parametrize("activated", [False, True])
@pytest.mark.parametrize("radius", [0, 1])
def test_margins_are_neighbours_or_mirror_images(shape, activated, radius):
    one, two = value(shape), value(shape, 2, seed=1)
    sources = [Source(0, 2, activated=activated), Source(1, 2)]
    whole = torch.cat([one[:, :2].relu() if activated else one[:, :2], two], dim=1)
    whole = functional.pad(whole, (radius,) * 4, mode="reflect") if radius else whole
    for region in regions_of(*shape):
        found = gathered(sources, [one, two], region, radius, 0, torch.float32)
        assert torch.equal(found, cut(whole, region, radius))


def test_a_wide_margin_is_mirrored_where_a_region_is_near_the_border():
    one = value((9, 10))
    whole = functional.pad(one, (3,) * 4, mode="reflect")
    for region in (Region(0, 0, 9, 10), Region(1, 2, 2, 3), Region(7, 8, 8, 10)):
        found = gathered([Source(0, 3)], [one], region, 3, 0, torch.float32)
        assert torch.equal(found, cut(whole, region, 3))


@pytest.mark.parametrize("shape", SHAPES, ids=str)
@pytest.mark.parametrize("doubling", ["edges", "corners"])
@pytest.mark.parametrize("activated", [False, True])
def test_doubling_is_bilinear_and_a_part_has_the_bits_of_the_whole(shape, doubling, activated):
    one = value(shape)
    source = Source(0, 3, doubling, activated)
    height, width = 2 * shape[0], 2 * shape[1]
    all_cells = Region(0, 0, height, width)
    whole = gathered([source], [one], all_cells, 1, 0, torch.float32)
    cells = one.double().relu() if activated else one.double()
    corners = doubling == "corners"
    wanted = functional.interpolate(cells, (height, width), mode="bilinear", align_corners=corners)
    wanted = functional.pad(wanted, (1,) * 4, mode="reflect")
    torch.testing.assert_close(whole.double(), wanted, atol=1e-6, rtol=0)
    for region in regions_of(height, width):
        found = gathered([source], [one], region, 1, 0, torch.float32)
        assert torch.equal(found, cut(whole, region, 1))


def test_a_doubled_map_stands_beside_a_finer_one():
    fine, coarse = value((6, 8)), value((3, 4), 2, seed=1)
    sources = [Source(0, 3), Source(1, 2, "edges")]
    found = gathered(sources, [fine, coarse], Region(0, 0, 6, 8), 0, 0, torch.float32)
    doubled = functional.interpolate(coarse, scale_factor=2, mode="bilinear")
    torch.testing.assert_close(found, torch.cat([fine, doubled], dim=1), atol=1e-6, rtol=0)


@pytest.mark.parametrize("width", [1, 4, 10])
@pytest.mark.parametrize("kernel", [1, 3, 7])
@pytest.mark.parametrize("channels", [1, 16])
@pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16], ids=str)
def test_pixels_computed_together_are_those_computed_alone(width, kernel, channels, dtype):
    torch.manual_seed(0)
    layer = torch.nn.Conv2d(channels, 3, kernel, padding=kernel // 2).to(dtype)
    convolution = packed(layer, dtype, together=4)
    rows, columns = 5 + 2 * convolution.radius, width + 2 * convolution.radius
    padded = torch.randn(1, channels, rows, columns).to(dtype)
    spare = functional.pad(padded, (0, convolution.spare(width)))
    with torch.no_grad():
        wanted = functional.conv2d(padded.float(), layer.weight.float(), layer.bias.float())
        found = convolution(spare.contiguous(memory_format=torch.channels_last), width)
    assert convolution.channels == 3
    tolerance = 1e-5 if dtype == torch.float32 else 0.02
    torch.testing.assert_close(found.float(), wanted, atol=tolerance, rtol=tolerance)
