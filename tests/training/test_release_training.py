"""The published architecture, small: it can be trained here as well."""

from dataclasses import replace

import pytest
import torch
from small_world import small_clips, small_training

from pe_runtime.config import (
    ActionConfig,
    BendingConfig,
    EncoderConfig,
    FeatureRendererConfig,
    FieldConfig,
    ModelConfig,
    ObjectClassConfig,
    ObjectConfig,
)
from pe_runtime.networks import SynthesisNetworks
from pe_runtime.training.synthesis_phase import SynthesisPhase

WIDTH, HEIGHT = 64, 32
FIELD = FieldConfig(
    width=16, depth=3, skip=1, octaves=3, base_frequency=0.5, head_width=12, branch_width=8,
    density="relu", density_scale=1.0,
)  # fmt: skip
STATIC = EncoderConfig(
    design="residual", crop="visible-volume", resampling="max", view="none", height=16, width=16,
    channels=(4, 8),
)  # fmt: skip
PLAYER = EncoderConfig(
    design="attentive", crop="box", resampling="max", widen=(0.5, 0.2), view="camera",
    height=16, width=16, channels=(4, 8),
)  # fmt: skip
HEADING = replace(STATIC, crop="box")


def release_config():
    """One court, a sky and two players with headings, y natively up."""
    near = {"depth_range": (0.05, 30.0), "style_features": 4}
    classes = {
        "court": ObjectClassConfig(
            low=(-6.0, -6.0, -0.3), high=(6.0, 6.0, 0.1), samples=4, field=FIELD, encoder=STATIC,
            **near,
        ),
        "sky": ObjectClassConfig(
            kind="sky", low=(-200.0,) * 3, high=(200.0,) * 3, samples=1, opaque=True,
            sees_origin=True, depth_range=(90.0, 91.0), style_features=4,
            field=replace(FIELD, base_frequency=1.0), encoder=STATIC,
        ),
        "player": ObjectClassConfig(
            kind="playable", low=(-0.6, -0.6, 0.0), high=(0.6, 0.6, 1.8), samples=6,
            pose_features=3, field=FIELD, encoder=PLAYER, lift=0.01, heading=HEADING,
            bending=BendingConfig(width=8, depth=3, skip=1, octaves=2, base_frequency=0.5), **near,
        ),
    }  # fmt: skip
    objects = [ObjectConfig("court", "court"), ObjectConfig("sky", "sky")]
    objects += [ObjectConfig(f"player_{i}", "player") for i in (1, 2)]
    renderer = FeatureRendererConfig(
        design="paper", activated_blocks=True, strides=(4, 8), features=(6, 8), widths=(6, 8),
        output_widths=(6, 4), blocks=2,
    )  # fmt: skip
    return ModelConfig(
        name="release", width=WIDTH, height=HEIGHT, quadrature="release-2022", native_up="y",
        carve_overlaps=True, classes=classes, objects=tuple(objects), feature_renderer=renderer,
        action=ActionConfig(actions=3),
    )  # fmt: skip


@pytest.fixture(scope="module")
def clips():
    return small_clips(width=WIDTH, height=HEIGHT)


def phase(clips, **training):
    torch.manual_seed(0)
    networks = SynthesisNetworks(release_config())
    training = small_training(patch_height=16, patch_width=16, **training)
    return SynthesisPhase(networks, clips, None, training)


def steps(trained, count):
    logs = []
    for step in range(count):
        torch.manual_seed(step)
        logs.append(trained.step(step / trained.config.steps))
    return logs


@pytest.mark.parametrize("bfloat16", [False, True])
def test_thirty_steps_lower_the_loss(clips, bfloat16):
    losses = [log["loss"] for log in steps(phase(clips, learning_rate=5e-3, bfloat16=bfloat16), 30)]
    assert sum(losses[-5:]) < 0.9 * sum(losses[:5])


def test_every_network_gets_a_finite_gradient(clips):
    trained = phase(clips, player_patches=1.0, density_noise=1.0)
    waiting = dict(trained.networks.named_parameters())
    for step in range(8):
        torch.manual_seed(step)
        trained.step(0.5)
        gradients = {
            n: p.grad for n, p in trained.networks.named_parameters() if p.grad is not None
        }
        assert all(torch.isfinite(each).all() for each in gradients.values())
        waiting = {n: p for n, p in waiting.items() if n not in gradients or not gradients[n].any()}
    assert not waiting
