"""Sequences in other colours."""

import torch

from pe_runtime.training.augmentation import recolour


def pictures(frames=8):
    torch.manual_seed(1)
    return torch.rand(frames, 3, 5, 7)


def test_a_share_of_nothing_changes_nothing():
    images = pictures()
    assert recolour(images, 2, 0.0) is images


def test_colours_stay_colours():
    changed = recolour(pictures(), 2, 1.0)
    assert changed.min() >= 0 and changed.max() <= 1
    assert not torch.equal(changed, pictures())


def test_frames_of_a_sequence_are_changed_alike():
    one = torch.rand(1, 3, 5, 7).expand(4, -1, -1, -1)
    changed = recolour(torch.cat([one, 1 - one]), 4, 1.0)
    assert (changed[:4] == changed[:1]).all()
    assert (changed[4:] == changed[4:5]).all()


def test_black_and_white_stay_what_they_are():
    torch.manual_seed(2)
    both = torch.stack([torch.zeros(3, 4, 4), torch.ones(3, 4, 4)])
    assert torch.equal(recolour(both, 1, 1.0), both)


def test_about_the_share_that_was_asked_for_is_changed():
    torch.manual_seed(3)
    images = torch.rand(400, 3, 2, 2)
    changed = (recolour(images, 1, 0.25) != images).flatten(1).any(1).float().mean()
    assert 0.15 < changed < 0.35
