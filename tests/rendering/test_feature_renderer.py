import pytest
import torch
from small_world import shake

from pe_runtime.config import FeatureRendererConfig
from pe_runtime.rendering.feature_renderer import FeatureRenderer

TWO = FeatureRendererConfig(strides=(2, 4), features=(5, 4), widths=(8, 6), output_widths=(7,))
ONE = FeatureRendererConfig(strides=(4,), features=(6,), widths=(8,), output_widths=(8, 4))
THREE = FeatureRendererConfig(
    strides=(1, 2, 4), features=(4, 4, 4), widths=(4, 4, 4), output_widths=(), blocks=2
)


def maps_for(config, height=16, width=24, frames=2, seed=0):
    generator = torch.Generator().manual_seed(seed)
    return [
        torch.randn(frames, channels, height // stride, width // stride, generator=generator)
        for stride, channels in zip(config.strides, config.features, strict=True)
    ]


@pytest.mark.parametrize("config", [TWO, ONE, THREE], ids=["two", "one", "three"])
def test_pictures_have_full_resolution_and_values_of_pictures(config):
    torch.manual_seed(0)
    renderer = FeatureRenderer(config)
    shake(renderer)
    pictures = renderer(maps_for(config))
    assert pictures.shape == (2, 3, 16, 24)
    assert (pictures >= 0).all() and (pictures <= 1).all()


def test_a_fresh_renderer_shows_the_first_three_channels_of_the_finest_map():
    torch.manual_seed(0)
    config = THREE
    maps = maps_for(config)
    torch.testing.assert_close(FeatureRenderer(config)(maps), torch.sigmoid(maps[0][:, :3]))


def test_every_input_resolution_matters():
    torch.manual_seed(0)
    renderer = FeatureRenderer(TWO)
    shake(renderer)
    maps = maps_for(TWO)
    wanted = renderer(maps)
    for index in range(2):
        changed = [each + 1 if i == index else each for i, each in enumerate(maps)]
        assert not torch.allclose(renderer(changed), wanted)


def test_pictures_of_a_batch_do_not_influence_each_other():
    torch.manual_seed(0)
    renderer = FeatureRenderer(TWO)
    shake(renderer)
    maps = maps_for(TWO)
    together = renderer(maps)
    alone = renderer([each[:1] for each in maps])
    torch.testing.assert_close(together[:1], alone, atol=1e-6, rtol=1e-5)


def test_extreme_features_give_extreme_but_finite_pictures():
    torch.manual_seed(0)
    renderer = FeatureRenderer(TWO)
    pictures = renderer([each * 1e6 for each in maps_for(TWO)])
    assert torch.isfinite(pictures).all()
