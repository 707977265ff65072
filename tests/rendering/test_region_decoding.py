"""A part of a picture is decoded from a part of the maps, to the last bit as in the whole."""

import pytest
import torch
from rendering.test_partial_decoding import CONFIGS, maps_of, renderer_of

from pe_runtime.rendering.partial_decoding import cells_of, decode
from pe_runtime.rendering.prepared_renderer import prepared
from pe_runtime.rendering.region_decoding import decode_part, needed_regions
from pe_runtime.rendering.regions import Region

CELLS = (12, 20)


@pytest.fixture(params=CONFIGS)
def config(request):
    return CONFIGS[request.param]


def parts_of(config):
    height, width = (n * config.strides[-1] for n in CELLS)
    return {
        "all": Region(0, 0, height, width),
        "first pixel": Region(0, 0, 1, 1),
        "last pixel": Region(height - 1, width - 1, height, width),
        "inside": Region(height // 2, width // 2, height // 2 + 3, width // 2 + 5),
        "a column": Region(0, width - 7, height, width - 6),
        "off the grid": Region(5, 3, height - 3, width // 2 + 1),
    }


def undefined_outside(whole, region):
    """The map with NaN in all cells that are not needed."""
    left = torch.full_like(whole, torch.nan)
    cells_of(left, region).copy_(cells_of(whole, region))
    return left


@pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16], ids=str)
def test_a_part_has_the_bits_of_the_whole_and_reads_nothing_but_what_it_needs(config, dtype):
    ready, maps = prepared(renderer_of(config), dtype), maps_of(config, CELLS)
    whole, _ = decode(ready, maps)
    for name, part in parts_of(config).items():
        needed = needed_regions(ready, tuple(whole.shape[1:]), part)
        given = [undefined_outside(m, own) for m, own in zip(maps, needed, strict=False)]
        drawn = cells_of(decode_part(ready, given, needed), part)
        assert torch.equal(drawn, cells_of(whole, part)), name


def test_a_small_part_needs_few_cells(config):
    ready = prepared(renderer_of(config))
    side = 100 * config.strides[-1]
    part = Region(side // 2, side // 2, side // 2 + 4, side // 2 + 4)
    needed = needed_regions(ready, (side, side), part)
    for stride, own in zip(config.strides, needed, strict=False):
        assert own.area < 0.1 * (side // stride) ** 2
