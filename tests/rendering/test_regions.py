"""Rectangles of changed cells: none is missed, and there are few."""

import pytest
import torch

from pe_runtime.rendering.prepared_renderer import TOGETHER
from pe_runtime.rendering.regions import GRID, MOST, Region, changed_regions, merged

MAP = Region(0, 0, 30, 50)


def covered(regions, shape):
    cells = torch.zeros(shape, dtype=torch.bool)
    for each in regions:
        cells[each.top : each.bottom, each.left : each.right] = True
    return cells


@pytest.mark.parametrize("share", [0.0, 0.0005, 0.01, 0.2, 1.0])
@pytest.mark.parametrize("shape", [(2, 2), (1, 9), (30, 50), (72, 128)], ids=str)
def test_all_changed_cells_are_in_one_of_few_regions(shape, share):
    generator = torch.Generator().manual_seed(7)
    for _ in range(5):
        changed = torch.rand(shape, generator=generator) < share
        regions = changed_regions(changed)
        assert len(regions) <= MOST
        assert not (changed & ~covered(regions, shape)).any()
        assert bool(regions) == bool(changed.any())


def test_two_players_have_a_region_each_and_no_more():
    changed = torch.zeros(30, 50, dtype=torch.bool)
    changed[3:9, 2:6] = True
    changed[20, 40:44] = True
    assert changed_regions(changed) == [Region(3, 2, 9, 6), Region(20, 40, 21, 44)]


def test_parts_of_one_player_share_a_region():
    changed = torch.zeros(30, 50, dtype=torch.bool)
    changed[3:9, 2:6] = True
    changed[6:12, 8:11] = True
    assert changed_regions(changed) == [Region(3, 2, 12, 11)]


def test_regions_that_overlap_much_are_joined_and_those_that_touch_corners_are_not():
    near = [Region(0, 0, 10, 10), Region(2, 2, 11, 10)]
    assert merged(near) == [Region(0, 0, 11, 10)]
    far = [Region(0, 0, 10, 10), Region(9, 9, 20, 20)]
    assert merged(far) == far


def test_small_regions_are_joined_where_calls_cost_more_than_cells():
    far = [Region(0, 0, 2, 2), Region(0, 8, 2, 10)]
    assert merged(far, call=11) == far
    assert merged(far, call=12) == [Region(0, 0, 2, 10)]


def test_what_has_been_joined_is_joined_with_what_it_then_reaches():
    chain = [Region(0, 0, 4, 4), Region(0, 4, 4, 8), Region(0, 8, 4, 12)]
    assert merged(chain) == [Region(0, 0, 4, 12)]


def test_work_lies_on_the_grid_and_ends_at_the_border():
    assert Region(5, 1, 6, 2).aligned(MAP) == Region(4, 0, 8, 4)
    assert Region(29, 49, 30, 50).aligned(MAP) == Region(28, 48, 30, 50)


def test_the_grid_keeps_pixels_together_that_are_computed_together():
    assert GRID % TOGETHER == 0


def test_a_region_grows_as_far_as_the_map_goes():
    assert Region(1, 2, 3, 49).grown(2, MAP) == Region(0, 0, 5, 50)
