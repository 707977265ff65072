"""Decoding only what changed gives what decoding everything gives, to the last bit."""

import pytest
import torch
from small_world import shake

from pe_runtime.config import FeatureRendererConfig
from pe_runtime.rendering import packed_convolution
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
        widths=(4, 5, 6), output_widths=(4,),
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


@pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16], ids=str)
def test_decoding_what_changed_gives_the_bits_of_decoding_everything(config, dtype):
    cells = (12, 20)
    ready, maps = prepared(renderer_of(config), dtype), maps_of(config, cells)
    for name, rectangles in RECTANGLES.items():
        _, before = decode(ready, maps)
        masks = changed_in(config, cells, rectangles)
        new = altered(maps, masks, config, cells)
        wanted, everything = decode(ready, new)
        picture, after = decode_again(ready, new, before, masks)
        assert torch.equal(picture, wanted), name
        for ours, theirs in zip(after.values, everything.values, strict=True):
            assert torch.equal(ours, theirs), name


def test_many_frames_of_changes_here_and_there_leave_no_trace(config):
    cells = (6, 9)
    ready, maps = prepared(renderer_of(config)), maps_of(config, cells)
    generator = torch.Generator().manual_seed(2)
    _, state = decode(ready, maps)
    for frame in range(8):
        masks = [torch.rand(m.shape[-2:], generator=generator) < 0.01 * (frame % 4) for m in maps]
        new = [torch.randn(m.shape, generator=generator) for m in maps]
        maps = [torch.where(m, b, a) for m, a, b in zip(masks, maps, new, strict=True)]
        picture, state = decode_again(ready, maps, state, masks)
        assert torch.equal(picture, decode(ready, maps)[0])


def test_a_change_in_one_map_alone_is_enough(config):
    cells = (6, 9)
    ready, maps = prepared(renderer_of(config)), maps_of(config, cells)
    for index in range(len(maps)):
        _, before = decode(ready, maps)
        masks = [torch.zeros(m.shape[-2:], dtype=torch.bool) for m in maps]
        masks[index][3, 4] = True
        new = [each + m for each, m in zip(maps, masks, strict=True)]
        picture, _ = decode_again(ready, new, before, masks)
        assert torch.equal(picture, decode(ready, new)[0])
        assert not torch.equal(picture, decode(ready, maps)[0])


def test_less_is_computed_where_less_has_changed(config, monkeypatch):
    cells = (16, 24)
    ready, maps = prepared(renderer_of(config)), maps_of(config, cells)
    _, before = decode(ready, maps)
    computed, call = [], packed_convolution.PackedConvolution.__call__

    def counted(self, padded, columns):
        out = call(self, padded, columns)
        computed.append(out[0, 0].numel())
        return out

    monkeypatch.setattr(packed_convolution.PackedConvolution, "__call__", counted)
    decode(ready, maps)
    everything = sum(computed)
    computed.clear()
    decode_again(ready, maps, before, changed_in(config, cells, [(0, 0, 1, 1)]))
    assert 0 < sum(computed) < 0.6 * everything


def test_where_nothing_changed_nothing_is_done(config, monkeypatch):
    cells = (4, 5)
    ready, maps = prepared(renderer_of(config)), maps_of(config, cells)
    wanted, before = decode(ready, maps)
    monkeypatch.delattr(packed_convolution.PackedConvolution, "__call__")
    picture, after = decode_again(ready, maps, before, changed_in(config, cells, []))
    assert after is before
    assert torch.equal(picture, wanted)


def test_an_earlier_picture_stays_as_it_was(config):
    cells = (16, 24)
    ready, maps = prepared(renderer_of(config)), maps_of(config, cells)
    first, before = decode(ready, maps)
    copy = first.clone()
    masks = changed_in(config, cells, [(0, 0, 1, 1)])
    second, _ = decode_again(ready, altered(maps, masks, config, cells), before, masks)
    assert torch.equal(first, copy)
    assert not torch.equal(second, first)


def test_maps_of_another_size_are_decoded_as_a_whole(config):
    ready = prepared(renderer_of(config))
    _, before = decode(ready, maps_of(config, (4, 5)))
    maps = maps_of(config, (5, 4))
    picture, _ = decode_again(ready, maps, before, changed_in(config, (5, 4), []))
    assert torch.equal(picture, decode(ready, maps)[0])


@pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16], ids=str)
def test_the_number_of_threads_changes_no_bit(config, dtype):
    ready, maps = prepared(renderer_of(config), dtype), maps_of(config, (12, 20))
    before, pictures = torch.get_num_threads(), []
    try:
        for threads in (1, 2, 3):
            torch.set_num_threads(threads)
            pictures.append(decode(ready, maps)[0])
    finally:
        torch.set_num_threads(before)
    assert torch.equal(pictures[0], pictures[1])
    assert torch.equal(pictures[0], pictures[2])


def test_without_onednn_parts_agree_to_rounding(config, monkeypatch):
    monkeypatch.setattr(packed_convolution, "_runs_on_onednn", lambda device, dtype: False)
    cells = (12, 20)
    ready, maps = prepared(renderer_of(config, 0.03)), maps_of(config, cells)
    assert not ready.same_in_parts
    masks = changed_in(config, cells, RECTANGLES["two far apart"])
    new = altered(maps, masks, config, cells)
    picture, _ = decode_again(ready, new, decode(ready, maps)[1], masks)
    assert (picture - decode(ready, new)[0]).abs().max() < 1e-6


def test_parts_are_the_same_on_a_cpu_with_onednn(config):
    if not torch.backends.mkldnn.is_available():
        pytest.skip("this build of torch has no oneDNN")
    assert prepared(renderer_of(config)).same_in_parts


def test_bfloat16_is_near_float32(config):
    renderer, maps = renderer_of(config, 0.03), maps_of(config, (5, 7))
    exact, _ = decode(prepared(renderer), maps)
    rough, _ = decode(prepared(renderer, torch.bfloat16), maps)
    assert rough.dtype == torch.float32
    assert 0 < (rough - exact).abs().max() < 0.03


def test_a_prepared_renderer_keeps_its_weights(config):
    renderer, maps = renderer_of(config), maps_of(config, (3, 4))
    ready = prepared(renderer)
    wanted, _ = decode(ready, maps)
    shake(renderer)
    assert torch.equal(decode(ready, maps)[0], wanted)


def test_extreme_features_give_finite_pictures(config):
    ready = prepared(renderer_of(config))
    picture, _ = decode(ready, [1e6 * each for each in maps_of(config, (3, 4))])
    assert torch.isfinite(picture).all()


def test_what_is_kept_is_counted_and_bounded():
    config = FeatureRendererConfig(
        design="paper", strides=(4, 8), features=(64, 128), widths=(64, 128),
        output_widths=(32, 16), blocks=3,
    )  # fmt: skip
    _, decoded = decode(prepared(renderer_of(config)), maps_of(config, (4, 8)))
    values = [each.numel() for each in (*decoded.values, decoded.picture)]
    assert decoded.nbytes == 4 * sum(values)
    assert decoded.nbytes / (32 * 64) < 300
