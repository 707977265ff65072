import dataclasses

import torch
from synthetic_states import make_states

from pe_runtime.action.sequences import stack_states


def test_headings_survive_taking_apart_and_joining():
    whole = make_states(2, steps=3).dataset.sequences()
    headings = torch.tensor([[0.1, 0.2, 0.3], [1.0, 2.0, 3.0]], requires_grad=True)
    turned = dataclasses.replace(whole, headings=headings)
    joined = stack_states([turned.at(t) for t in range(3)], turned.world_from_camera)
    assert torch.equal(joined.headings, headings)
    assert not turned.detach().headings.requires_grad


def test_without_headings_everyone_faces_along_the_axes_of_the_world():
    whole = make_states(2, steps=3).dataset.sequences()
    joined = stack_states([whole.at(t) for t in range(3)], whole.world_from_camera)
    assert joined.headings is None and whole.detach().headings is None
    assert torch.equal(whole.facings, torch.zeros(2, 3))
    assert torch.equal(whole.axes("object"), torch.eye(2).expand(2, 3, 2, 2))


def test_states_with_and_without_a_heading_join_with_zeros():
    whole = make_states(2, steps=2).dataset.sequences()
    states = [whole.at(0), dataclasses.replace(whole.at(1), heading=torch.tensor([0.5, 0.6]))]
    joined = stack_states(states, whole.world_from_camera)
    assert torch.equal(joined.headings, torch.tensor([[0.0, 0.5], [0.0, 0.6]]))
