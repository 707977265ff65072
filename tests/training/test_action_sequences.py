import dataclasses

import pytest
import torch
from synthetic_states import make_states

from pe_runtime.contract.errors import EpisodeError
from pe_runtime.training.action_sequences import join, without_jumps


@pytest.fixture
def data():
    return make_states(5, steps=8).dataset


def test_windows_are_pieces_of_sequences(data):
    window = data.sample(torch.Generator().manual_seed(0), 20, 3)
    assert window.positions.shape == (20, 3, 3)
    pieces = data.positions.unfold(1, 3, 1).flatten(0, 1).mT
    for each in window.positions:
        assert (pieces == each).all(dim=(1, 2)).any()


def test_windows_of_the_same_generator_state_are_equal(data):
    first, again = (data.sample(torch.Generator().manual_seed(3), 4, 5) for _ in range(2))
    assert torch.equal(first.poses, again.poses)


@pytest.mark.parametrize("steps", [8, 100])
def test_a_window_is_never_longer_than_its_sequence(data, steps):
    window = data.sample(torch.Generator().manual_seed(0), 4, steps)
    assert window.poses.shape == (4, 8, 16)


def test_styles_are_held_along_a_sequence(data):
    whole = data.sequences()
    assert torch.equal(whole.styles[:, 0], data.styles)
    assert torch.equal(whole.styles[:, 7], data.styles)


def test_a_sequence_with_a_jump_is_left_out(data):
    positions = data.positions.clone()
    positions[2, 4:] += torch.tensor([5.0, 0.0, 0.0])
    kept = without_jumps(dataclasses.replace(data, positions=positions), 1.5)
    assert torch.equal(kept.positions, positions[[0, 1, 3, 4]])
    assert torch.equal(kept.true_actions, data.true_actions[[0, 1, 3, 4]])


@pytest.mark.parametrize("name", ["positions", "styles", "poses", "world_from_camera", "headings"])
def test_nan_in_the_states_is_refused_by_name(data, name):
    data = dataclasses.replace(data, headings=torch.zeros(5, 8))
    values = getattr(data, name).clone()
    values.view(-1)[3] = torch.nan
    with pytest.raises(EpisodeError, match=name):
        dataclasses.replace(data, **{name: values})


def test_datasets_of_several_objects_join(data):
    both = join([data, make_states(3, steps=8, seed=1).dataset])
    assert len(both) == 8
    assert both.true_actions.shape == (8, 7)
    assert join([data, dataclasses.replace(data, true_actions=None)]).true_actions is None


def test_joining_nothing_or_what_does_not_fit_is_an_error(data):
    with pytest.raises(EpisodeError, match="no sequences"):
        join([])
    with pytest.raises(EpisodeError, match="agree"):
        join([data, make_states(3, steps=9).dataset])


def test_headings_go_where_their_sequences_go(data):
    headings = torch.arange(40.0).reshape(5, 8)
    turned = dataclasses.replace(data, headings=headings)
    assert torch.equal(turned.sequences().headings, headings)
    assert torch.equal(turned.first(2).headings, headings[:2])
    assert torch.equal(join([turned, turned]).headings, torch.cat([headings, headings]))
    window = turned.sample(torch.Generator().manual_seed(0), 20, 3)
    for positions, angles in zip(window.positions, window.headings, strict=True):
        start = int(angles[0])
        assert torch.equal(angles, torch.arange(start, start + 3.0))
        assert torch.equal(positions, data.positions[start // 8, start % 8 : start % 8 + 3])
    assert data.sample(torch.Generator(), 4, 3).headings is None
