"""Octaves that open over the training, and what is stored of a run that ends before."""

import torch
from small_world import small_clips, small_config, small_training

from pe_runtime.checkpoint import load_checkpoint
from pe_runtime.field.layers import PositionalEncoding
from pe_runtime.networks import SynthesisNetworks
from pe_runtime.training.octaves import OctaveWindows, window
from pe_runtime.training.synthesis_phase import SynthesisPhase, load_synthesis
from pe_runtime.training.synthesis_run import RunOptions, train_synthesis


def networks():
    torch.manual_seed(0)
    return SynthesisNetworks(small_config(width=40, height=24))


def test_a_window_opens_octave_by_octave_and_never_closes_the_point():
    encoding = PositionalEncoding(2, 2, 1.0)
    half = (1 - torch.cos(torch.tensor(torch.pi / 2))) / 2
    for share, low, high in ((0.0, 0.0, 0.0), (0.25, half, 0.0), (0.5, 1.0, 0.0), (1.0, 1.0, 1.0)):
        wanted = torch.tensor([1, 1, low, low, high, high, low, low, high, high])
        torch.testing.assert_close(window(encoding, share), wanted)


def test_weights_of_a_window_belong_to_the_features_of_their_octave():
    encoding = PositionalEncoding(3, 4, 1.0)
    point = torch.tensor([0.3, -0.2, 0.9])
    shown = encoding(point) * window(encoding, 0.5)
    wanted = PositionalEncoding(3, 2, 1.0)(point)
    assert torch.equal(shown[shown != 0], wanted)


def test_fields_and_bending_open_each_in_their_own_time():
    found = networks()
    player = found.fields["player"]
    points = torch.rand(5, 3)
    plain = player.encoding(points), player.bending.encoding(points)
    windows = OctaveWindows(found, 0.5, 0.25)
    for progress, fields_open, bending_open in (
        (0.1, False, False),
        (0.3, False, True),
        (0.5,) + (True,) * 2,
    ):
        windows.open(progress)
        now = player.encoding(points), player.bending.encoding(points)
        same = [torch.equal(a, b) for a, b in zip(now, plain, strict=True)]
        assert same == [fields_open, bending_open]


def test_without_a_share_encodings_are_not_even_watched():
    found = networks()
    windows = OctaveWindows(found, 0.0, 0.0)
    windows.open(0.0)
    assert not windows.windows
    assert not found.fields["player"].encoding._forward_hooks


def test_a_training_opens_its_octaves_and_the_closed_ones_learn_nothing():
    training = small_training(octaves_until=1.0, steps=10, player_patches=1.0)
    phase = SynthesisPhase(networks(), small_clips(), None, training)
    torch.manual_seed(0)
    phase.step(0.0)
    weight = phase.networks.fields["ground"].layers[0].weight
    assert weight.grad[:, :2].any() and not weight.grad[:, 2:].any()
    phase.step(0.9)
    assert weight.grad[:, 2:].any()


def test_a_run_that_ends_early_is_stored_with_its_windows_in_the_weights(tmp_path):
    config = small_config(width=40, height=24)
    training = small_training(steps=1000, octaves_until=1.0, bending_octaves_until=0.5)
    # The first step is made when no time is gone, and is the last.
    trained = train_synthesis(
        (config, training), (small_clips(), None), tmp_path, RunOptions(minutes=1e-9)
    )
    stored = SynthesisNetworks(config).eval()
    load_synthesis(stored, load_checkpoint(tmp_path / "synthesis.safetensors")[1])
    points = torch.rand(6, 1, 3)
    frame, pose = torch.zeros(6, dtype=torch.long), torch.zeros(1, 3)
    player, again = trained.fields["player"], stored.fields["player"]
    torch.testing.assert_close(player.trunk(points, frame, pose), again.trunk(points, frame, pose))
    assert player.layers[0].weight[:, 3:].any() and not again.layers[0].weight[:, 3:].any()
