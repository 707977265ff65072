"""The rows of the ablation tables are models that train, and are drawn alike in both ways."""

from dataclasses import replace

import pytest
import torch
from small_world import (
    camera,
    random_codes,
    shake,
    small_clips,
    small_config,
    small_networks,
    small_training,
)

from pe_runtime.benchmark.reference_field import ReferenceField
from pe_runtime.config.ablations import ACTION_ROWS, SYNTHESIS_ROWS, ablated_synthesis
from pe_runtime.contract.errors import ConfigError
from pe_runtime.field.layers import build_modulation
from pe_runtime.field.object_field import ObjectField
from pe_runtime.frame_renderer import FrameRenderer
from pe_runtime.geometry.cameras import Cameras
from pe_runtime.networks import SynthesisNetworks
from pe_runtime.rendering.scene import RenderSettings
from pe_runtime.training.action_config import ActionTrainingConfig, ablated_actions
from pe_runtime.training.synthesis_phase import SynthesisPhase

WIDTH, HEIGHT = 40, 24


def ablated(row):
    model = small_config(width=WIDTH, height=HEIGHT)
    return ablated_synthesis(model, small_training(), row)


@pytest.mark.parametrize("row", SYNTHESIS_ROWS)
def test_every_row_trains(row):
    model, training = ablated(row)
    torch.manual_seed(0)
    phase = SynthesisPhase(SynthesisNetworks(model), small_clips(), None, training)
    before = {name: each.clone() for name, each in phase.networks.named_parameters()}
    for step in range(4):
        phase.step(0.2 + 0.1 * step)
    changed = [n for n, each in phase.networks.named_parameters() if (each != before[n]).any()]
    assert any(name.startswith("fields.") for name in changed)


@pytest.mark.parametrize("row", [row for row in SYNTHESIS_ROWS if row != "plain"])
def test_the_frame_renderer_draws_a_row_as_training_does(row):
    model, _ = ablated(row)
    networks = small_networks(model)
    codes = random_codes(model)
    views = Cameras.stack([camera(width=WIDTH, rows=HEIGHT)])
    settings = RenderSettings(near=model.near)
    with torch.no_grad():
        slow = networks.synthesise(
            views, codes, torch.zeros(1, 2, dtype=torch.long), (HEIGHT, WIDTH), settings
        )[0]
    fast, _ = FrameRenderer(networks).draw(views, codes, settings)
    assert (fast - slow).abs().max() < 2e-5


def test_a_picture_without_a_convnet_is_drawn_again_where_something_moved():
    model, _ = ablated("modulation")
    networks = small_networks(model)
    views = Cameras.stack([camera(width=WIDTH, rows=HEIGHT)])
    settings = RenderSettings(near=model.near)
    renderer, before = FrameRenderer(networks), random_codes(model)
    renderer.draw(views, before, settings)
    moved = before["player_1"].position + torch.tensor([0.3, 0.0, 0.0])
    after = before | {"player_1": replace(before["player_1"], position=moved)}
    again, _ = renderer.draw(views, after, settings)
    fresh, _ = FrameRenderer(networks).draw(views, after, settings)
    assert torch.equal(again, fresh)


def test_rows_have_what_their_ticks_say():
    for row, has in SYNTHESIS_ROWS.items():
        model, _ = ablated(row)
        kinds = model.classes.values()
        assert (len(model.objects) > 1) == bool(has.multi)
        assert any(each.bending is not None for each in kinds) == bool(has.pose)
        assert any(each.style_features > 0 for each in kinds) == bool(has.style)
        assert {each.style_input for each in kinds} == {
            "concatenation" if has.style == "~" else "modulation"
        }
        assert (model.feature_renderer.design == "direct") == (not has.renderer)
        assert (len(model.feature_renderer.strides) == 1) == (has.renderer != "x")


def test_the_full_row_is_the_configuration_itself():
    model, training = small_config(), small_training()
    assert ablated_synthesis(model, training, "full") == (model, training)


def test_an_unknown_row_is_refused_with_the_known_ones():
    with pytest.raises(ConfigError, match="multi-pose"):
        ablated("nothing")


def test_concatenation_is_a_layer_that_sees_the_style_beside_the_features():
    torch.manual_seed(0)
    layer, way = torch.nn.Linear(5, 4), build_modulation("concatenation", 3, 4)
    hidden, style = torch.randn(7, 5), torch.randn(1, 3)
    scale, shift = way(style)
    beside = torch.cat([layer.weight, way.shift.weight], dim=1)
    wide = torch.cat([hidden, style.expand(7, -1)], dim=1) @ beside.T + layer.bias
    torch.testing.assert_close(layer(hidden) * scale + shift, wide)


@pytest.mark.parametrize("changes", [{"style_input": "concatenation"}, {"style_features": 0}])
def test_a_field_agrees_with_its_float64_twin(changes):
    config = replace(small_config().classes["player"], **changes)
    field = ObjectField(config, 6)
    shake(field)
    style, pose = torch.randn(1, config.style_features), torch.randn(1, config.pose_features)
    points = torch.rand(9, 3) * 2 - 1
    frame = torch.zeros(9, dtype=torch.long)
    hidden = field.trunk(points[:, None], frame, pose)
    found = field.output(field.branch(hidden, frame, style))[:, 0]
    weights = {name: each.double() for name, each in field.state_dict().items()}
    twin = ReferenceField(config, weights, style[0].double(), pose[0].double())
    torch.testing.assert_close(
        found.double(), twin.features(points.double(), slice(0, 6)), rtol=1e-4, atol=1e-5
    )


def test_action_rows_lack_what_their_ticks_say():
    full = ActionTrainingConfig()
    for row, has in ACTION_ROWS.items():
        training = ablated_actions(full, row)
        assert (training.dynamics_frame == "world") == (not has.relative)
        assert (training.adversarial_weight > 0) == has.discriminator
        assert (training.movement_weight > 0) == has.movement_loss
        assert (training.action_weight > 0) == has.action_loss
    assert ablated_actions(full, "full") == full
    with pytest.raises(ConfigError, match="A, B, C, D, E, full"):
        ablated_actions(full, "F")
