import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from interop.perception_twin import cells

from pe_runtime.perception.region_pooling import EMPTY, max_pool_regions

ROWS, COLUMNS = 9, 13


def slow(image, region, height, width):
    """The twin: one cell after the other."""
    left, top, right, bottom = region
    pooled = np.full((image.shape[0], height, width), EMPTY, dtype=np.float32)
    for i, (y0, y1) in enumerate(cells(top, bottom, height, image.shape[1])):
        for j, (x0, x1) in enumerate(cells(left, right, width, image.shape[2])):
            if y1 > y0 and x1 > x0:
                pooled[:, i, j] = image[:, y0:y1, x0:x1].max(axis=(1, 2))
    return pooled


def pictures(count, rows=ROWS, columns=COLUMNS, seed=0):
    generator = torch.Generator().manual_seed(seed)
    return torch.rand(count, 3, rows, columns, generator=generator)


def agree(images, regions, height, width):
    regions = torch.tensor(regions, dtype=torch.float32)
    pooled = max_pool_regions(images, regions, height, width)
    for image, region, each in zip(images, regions, pooled, strict=True):
        np.testing.assert_array_equal(
            each.numpy(), slow(image.numpy(), region.tolist(), height, width)
        )


edges = st.floats(-20.0, 30.0).map(lambda x: round(2 * x) / 2) | st.floats(-20.0, 30.0)


@given(st.tuples(edges, edges, edges, edges), st.integers(1, 7), st.integers(1, 17))
def test_any_region_is_pooled_as_cell_by_cell(region, height, width):
    agree(pictures(1), [region], height, width)


def test_regions_of_very_different_sizes_are_pooled_at_once():
    regions = [(0, 0, 13, 9), (3, 2, 3, 2), (-40, -3, 90, 4.5), (5.5, 1.5, 6.5, 2.5)]
    agree(pictures(4), regions, 6, 5)


@pytest.mark.parametrize("crop", [(64, 64), (64, 256), (144, 256), (48, 80)])
def test_large_pictures_and_the_crops_of_real_models_agree_as_well(crop):
    images = pictures(3, 60, 100)
    agree(images, [(0, 0, 100, 60), (10.3, 5.2, 31.7, 58.9), (90.5, -7.5, 130, 22)], *crop)


def test_a_region_of_whole_pixels_has_both_its_edges():
    images = pictures(1)
    pooled = max_pool_regions(images, torch.tensor([[2.0, 1.0, 4.0, 2.0]]), 2, 3)
    assert torch.equal(pooled, images[:, :, 1:3, 2:5])


@pytest.mark.parametrize(("edge", "pixel"), [(2.5, 3), (3.5, 4), (2.4, 2), (0.5, 1)])
def test_halves_are_rounded_away_from_zero(edge, pixel):
    images = pictures(1)
    pooled = max_pool_regions(images, torch.tensor([[edge, 1.0, edge, 1.0]]), 1, 1)
    assert torch.equal(pooled[:, :, 0, 0], images[:, :, 1, pixel])


def test_negative_halves_are_rounded_away_from_zero_too():
    # The region is the column -1 alone, outside the picture; rounded to even it would be 0.
    pooled = max_pool_regions(pictures(1), torch.tensor([[-0.5, 1.0, -0.5, 1.0]]), 1, 1)
    assert (pooled == EMPTY).all()


def test_cells_outside_the_picture_are_mid_grey():
    pooled = max_pool_regions(pictures(1) * 0, torch.tensor([[-13.0, 0.0, 12.0, 8.0]]), 1, 2)
    assert pooled[0, 0].tolist() == [[EMPTY, 0.0]]


def test_an_inverted_region_is_one_pixel_wide():
    images = pictures(1)
    pooled = max_pool_regions(images, torch.tensor([[5.0, 3.0, 1.0, 3.0]]), 1, 4)
    assert torch.equal(pooled[0, :, 0], images[0, :, 3, 5, None].expand(-1, 4))


def test_huge_regions_overflow_nothing():
    images = pictures(1)
    pooled = max_pool_regions(images, torch.tensor([[-3e38, -3e38, 3e38, 3e38]]), 1, 1)
    assert torch.equal(pooled[..., 0, 0], images.amax(dim=(-2, -1)))


def test_a_cell_s_gradient_goes_to_its_largest_pixel():
    images = pictures(1).requires_grad_()
    max_pool_regions(images, torch.tensor([[0.0, 0.0, 12.0, 8.0]]), 1, 1).sum().backward()
    largest = images == images.amax(dim=(-2, -1), keepdim=True)
    assert torch.equal(images.grad, largest.float())


def test_gradients_agree_with_finite_differences():
    images = pictures(2, 5, 6).double().requires_grad_()
    regions = torch.tensor([[0.6, 0.0, 5.2, 3.0], [-2.0, 1.0, 3.0, 9.0]])

    def pool(pixels):
        return max_pool_regions(pixels, regions, 2, 3)

    assert torch.autograd.gradcheck(pool, (images,))


def test_no_pictures_give_no_crops():
    assert max_pool_regions(pictures(0), torch.zeros(0, 4), 4, 5).shape == (0, 3, 4, 5)
