"""Modules without the actions that nobody takes."""

import dataclasses

import pytest
import torch
from small_world import shake
from synthetic_states import make_states

from pe_runtime.action.module import ActionModule
from pe_runtime.config import ActionConfig
from pe_runtime.training.pruning import with_actions

KEPT = [0, 2, 3]
SMALL = ActionConfig(actions=5, variability=2, hidden=8, dynamics_width=8)
DESIGNS = {
    "ours": {},
    "of states": {"design": "state"},
    "two layers, all seen": {
        "dynamics_layers": 2,
        "sees_heading": True,
        "predict_heading": True,
        "predict_style": True,
    },
}


@pytest.mark.parametrize("changes", DESIGNS.values(), ids=DESIGNS)
def test_what_stays_does_the_same(changes):
    torch.manual_seed(0)
    data = make_states(6, steps=6).dataset
    codes = data.styles.shape[1], data.poses.shape[2]
    whole = ActionModule(dataclasses.replace(SMALL, **changes), *codes).eval()
    shake(whole)
    part, sequence = with_actions(whole, KEPT, codes), data.sequences()
    actions = torch.randint(len(KEPT), (len(data), 5))
    before = whole.play(sequence.at(0), torch.tensor(KEPT)[actions], sequence.world_from_camera)
    after = part.play(sequence.at(0), actions, sequence.world_from_camera)
    torch.testing.assert_close(after.positions, before.positions)
    torch.testing.assert_close(after.poses, before.poses)
    logits = whole.action_network(sequence).logits[..., KEPT]
    torch.testing.assert_close(part.action_network(sequence).logits, logits)
    assert part.config.actions == len(KEPT)


def test_keeping_all_in_another_order_renames_them():
    torch.manual_seed(0)
    data = make_states(4, steps=4).dataset
    codes = data.styles.shape[1], data.poses.shape[2]
    whole = ActionModule(SMALL, *codes).eval()
    turned = with_actions(whole, [4, 3, 2, 1, 0], codes)
    assert torch.equal(4 - whole.infer(data.sequences()), turned.infer(data.sequences()))
