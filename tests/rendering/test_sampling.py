import torch

from pe_runtime.rendering.sampling import grid_pixels, sample_intervals


def test_rays_pass_through_the_centres_of_their_blocks_row_by_row():
    pixels = grid_pixels(4, 8, 4, 6, 2)
    assert pixels.tolist() == [[9, 5], [11, 5], [13, 5], [9, 7], [11, 7], [13, 7]]


def test_stride_one_gives_pixel_centres():
    assert grid_pixels(0, 0, 1, 2, 1).tolist() == [[0.5, 0.5], [1.5, 0.5]]


def test_a_window_shows_the_rays_of_the_whole_frame():
    whole = grid_pixels(0, 0, 16, 32, 4).reshape(4, 8, 2)
    part = grid_pixels(4, 8, 8, 12, 4).reshape(2, 3, 2)
    assert torch.equal(part, whole[1:3, 2:5])


def test_samples_are_the_middles_of_equal_intervals():
    near, far = torch.tensor([1.0, 0.0]), torch.tensor([3.0, 0.0])
    samples, step = sample_intervals(near, far, 4)
    assert samples[0].tolist() == [1.25, 1.75, 2.25, 2.75]
    assert samples[1].tolist() == [0.0] * 4
    assert step.tolist() == [0.5, 0.0]


def test_jitter_stays_in_its_interval():
    near, far = torch.full((50,), 2.0), torch.full((50,), 4.0)
    jitter = torch.rand(50, 8, generator=torch.Generator().manual_seed(0))
    samples, step = sample_intervals(near, far, 8, jitter)
    index = ((samples - 2.0) / step[:, None]).floor()
    assert torch.equal(index, torch.arange(8.0).expand(50, 8))
    assert (samples.diff(dim=-1) > 0).all()
