"""Decoding only what changed gives what decoding everything gives, to the last bit."""

import pytest
import torch
from small_world import shake

from pe_runtime.config import FeatureRendererConfig
from pe_runtime.rendering.feature_renderer import build_feature_renderer
from pe_runtime.rendering.partial_decoding import decode, decode_again
from pe_runtime.rendering.prepared_renderer import prepared

LIGHT = FeatureRendererConfig(
    strides=(2, 4), features=(5, 6), widths=(8, 6), output_widths=(7,), blocks=2
)
CONFIGS = {
    "light": LIGHT,
    "light, one map": FeatureRendererConfig(
        strides=(4,), features=(6,), widths=(8,), output_widths=(8, 4)
    ),
    "light, finest map per pixel": FeatureRendererConfig(
        strides=(1, 2, 4), features=(4, 4, 4), widths=(4, 4, 4), output_widths=()
    ),
    "paper": FeatureRendererConfig(
        design="paper", strides=(4, 8), features=(3, 5), widths=(4, 5), output_widths=(4, 3),
        blocks=3,
    ),
    "paper, activated": FeatureRendererConfig(
        design="paper", activated_blocks=True, strides=(2, 4, 8), features=(3, 5, 4),
        widths=(4, 5, 6), output_widths=(4,), blocks=2,
    ),
}  # fmt: skip


@pytest.fixture(params=CONFIGS)
def config(request):
    return CONFIGS[request.param]


def renderer_of(config, amount=0.1):
    torch.manual_seed(0)
    renderer = build_feature_renderer(config)
    shake(renderer, amount)
    return renderer


def maps_of(config, cells, seed=0):
    """Maps of which the coarsest has that many cells."""
    generator = torch.Generator().manual_seed(seed)
    coarsest = config.strides[-1]
    return [
        torch.randn(1, channels, *[n * coarsest // stride for n in cells], generator=generator)
        for stride, channels in zip(config.strides, config.features, strict=True)
    ]


def changed_in(config, cells, rectangles):
    """Masks of the cells that such rectangles touch; rows and columns of the coarsest map."""
    masks = []
    for stride in config.strides:
        scale = config.strides[-1] // stride
        mask = torch.zeros([n * scale for n in cells], dtype=torch.bool)
        for top, left, bottom, right in rectangles:
            mask[top * scale : bottom * scale, left * scale : right * scale] = True
        masks.append(mask)
    return masks


def altered(maps, masks, config, cells):
    others = maps_of(config, cells, seed=1)
    return [torch.where(m, other, each) for m, other, each in zip(masks, others, maps, strict=True)]


@pytest.mark.parametrize("cells", [(2, 2), (5, 7), (12, 20)], ids=str)
def test_a_decoded_picture_is_the_renderers(config, cells):
    # Larger weights give logits whose last bit is more than 1e-6 of the picture. In float32 the
    # module itself is no measure: its doubling from corner to corner rounds positions to 1e-6.
    renderer, maps = renderer_of(config, 0.03), maps_of(config, cells)
    picture, _ = decode(prepared(renderer), maps)
    assert picture.std() > 0.09
    wanted = renderer.double()([each.double() for each in maps])[0]
    assert (picture - wanted).abs().max() < 1e-6


RECTANGLES = {
    "one cell in the middle": [(6, 9, 7, 10)],
    "a corner": [(0, 0, 1, 1)],
    "the last corner": [(11, 19, 12, 20)],
    "an edge": [(0, 4, 1, 17)],
    "two far apart": [(1, 1, 3, 2), (9, 16, 11, 18)],
    "everything": [(0, 0, 12, 20)],
}


@pytest.mark.parametrize("rectangles", RECTANGLES)
@pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16], ids=str)
def test_decoding_what_changed_gives_the_bits_of_decoding_everything(config, rectangles, dtype):
    cells = (12, 20)
    ready, maps = prepared(renderer_of(config), dtype), maps_of(config, cells)
    masks = changed_in(config, cells, RECTANGLES[rectangles])
    new = altered(maps, masks, config, cells)
    wanted, all_values = decode(ready, new)
    _, before = decode(ready, maps)
    picture, after = decode_again(ready, new, before, masks)
    assert torch.equal(picture, wanted)
    for ours, theirs in zip(after.values, all_values.values, strict=True):
        assert torch.equal(ours, theirs)
