import pytest
import torch

from pe_runtime.action.sampling import Noise, Sampling, sample_actions


def noise(seed=0):
    return Noise(torch.Generator().manual_seed(seed))


@pytest.mark.parametrize("dtype", [torch.bfloat16, torch.float16, torch.float32, torch.float64])
def test_exponential_noise_is_neither_zero_nor_infinite_in_any_precision(dtype):
    drawn = noise().exponential(torch.zeros(20_000, dtype=dtype))
    assert drawn.dtype == dtype
    assert torch.isfinite(drawn).all() and (drawn > 0).all()
    assert drawn.double().mean().item() == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize("soft", [True, False])
def test_actions_are_drawn_from_bfloat16_logits_without_a_nan(soft):
    logits = torch.zeros(5_000, 5, dtype=torch.bfloat16, requires_grad=True)
    drawn = sample_actions(logits, Sampling(1.0, 0.0, 0.0, noise(), soft))
    drawn.square().sum().backward()
    assert torch.isfinite(drawn).all() and torch.isfinite(logits.grad).all()
    shares = drawn.detach().float().mean(dim=0)
    assert shares.tolist() == pytest.approx([0.2] * 5, abs=0.03)
