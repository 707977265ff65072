"""Whether bfloat16 pays on this machine."""

import functools

import torch


@functools.cache
def _by_kind(kind: str) -> bool:
    if kind == "cuda":
        return torch.cuda.is_bf16_supported()
    if kind != "cpu":
        return False
    # Without such instructions the products are emulated, and slower than float32.
    return bool(torch.cpu._is_avx512_bf16_supported() or torch.cpu._is_amx_tile_supported())


def multiplies_bfloat16(device: torch.device) -> bool:
    """Whether a device has instructions for bfloat16 products with float32 sums."""
    return _by_kind(device.type)
