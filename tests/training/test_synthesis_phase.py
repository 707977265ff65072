import json
import os
import signal
from dataclasses import replace
from types import SimpleNamespace

import pytest
import torch
from small_world import small_clips, small_config, small_training
from thin_vgg import write_vgg

from pe_runtime.checkpoint import load_checkpoint, save_checkpoint
from pe_runtime.contract.errors import CheckpointError, ConfigError
from pe_runtime.networks import SynthesisNetworks
from pe_runtime.training import loop
from pe_runtime.training.loop import METRICS, BrokenStepError, Schedule, TrainingError, run
from pe_runtime.training.synthesis_phase import SynthesisPhase, load_synthesis, prefixed
from pe_runtime.training.synthesis_run import RunOptions, train_synthesis

CLIPS = small_clips()
NAN = float("nan")


def phase(clips=CLIPS, seed=0, model=None, held_out=None, **training):
    torch.manual_seed(seed)
    networks = SynthesisNetworks(model or small_config(width=40, height=24))
    return SynthesisPhase(networks, clips, held_out, small_training(**training))


def steps(trained, count, start=0):
    logs = []
    for step in range(start, start + count):
        torch.manual_seed(step)
        logs.append(trained.step(step / trained.config.steps))
    return logs


def test_thirty_steps_lower_the_loss():
    losses = [log["loss"] for log in steps(phase(learning_rate=5e-3), 30)]
    assert sum(losses[-5:]) < 0.8 * sum(losses[:5])


@pytest.mark.parametrize("shared", [False, True])
def test_every_parameter_gets_a_gradient_within_a_few_steps(shared):
    encoder = replace(small_config().classes["player"].encoder, shared_trunk=shared)
    trained = phase(model=small_config(width=40, height=24, encoder=encoder), player_patches=1.0)
    waiting = dict(trained.networks.named_parameters())
    for step in range(6):
        steps(trained, 1, step)
        reached = [n for n, p in waiting.items() if p.grad is not None and p.grad.any()]
        for name in reached:
            del waiting[name]
    # The raw density and colour of a sky or a ground are infinite and modulated: no exceptions.
    assert not waiting


def test_the_first_step_warms_up_and_the_figures_are_finite():
    logs = steps(phase(), 3)
    assert logs[0]["rate"] < logs[2]["rate"]
    wanted = {"loss", "gradient", "rate", "psnr_patch", "perceptual"}
    assert wanted <= set(logs[0])
    assert all(torch.isfinite(torch.tensor(list(log.values()))).all() for log in logs)


@pytest.mark.parametrize("bfloat16", [False, True])
def test_a_step_in_either_precision_changes_the_weights(bfloat16):
    trained = phase(bfloat16=bfloat16)
    before = {n: p.detach().clone() for n, p in trained.networks.named_parameters()}
    steps(trained, 3)
    changed = [n for n, p in trained.networks.named_parameters() if not torch.equal(before[n], p)]
    assert len(changed) > 0.9 * len(before)


def without_boxes(which):
    boxes = CLIPS.boxes.clone()
    boxes[which] = NAN
    return replace(CLIPS, boxes=boxes)


@pytest.mark.parametrize(
    "which",
    [(slice(None),), (slice(None), slice(None), 0), (0,), (slice(None), 1)],
    ids=["nobody ever", "only one player", "nobody in one sequence", "nobody at one time"],
)
def test_frames_without_players_train(which):
    logs = steps(phase(without_boxes(which)), 3)
    assert all(log["gradient"] > 0 for log in logs)


def test_a_patch_that_no_ray_of_a_player_hits_trains(monkeypatch):
    trained = phase()
    corner = torch.zeros(4, 2, dtype=torch.long)
    corner[:, 1] = 24
    far = CLIPS.boxes.clone()
    far[..., [0, 2]] = torch.tensor([0.0, 2.0])
    far[..., [1, 3]] = torch.tensor([10.0, 22.0])
    trained.clips = replace(CLIPS, boxes=far)
    trained.patches = SimpleNamespace(corners=lambda boxes: corner)
    seen = []
    synthesise = trained.networks.synthesise
    monkeypatch.setattr(
        trained.networks,
        "synthesise",
        lambda cameras, codes, *rest: (
            seen.append(all(bool(codes[f"player_{i}"].visible.all()) for i in (1, 2)))
            or synthesise(cameras, codes, *rest)
        ),
    )
    (log,) = steps(trained, 1)
    assert seen == [True], "the players are in the scene, only not in the patch"
    assert log["gradient"] > 0
    density = trained.networks.fields["player"].density.weight.grad
    assert density is None or not density.any()


def test_an_environment_without_players_trains():
    trained = phase(small_clips(players=0), model=small_config(0, width=40, height=24))
    assert all(log["gradient"] > 0 for log in steps(trained, 2))


def codes_before_and_after(monkeypatch, **training):
    trained = phase(**training)
    encode, synthesise, caught = trained.networks.encode, trained.networks.synthesise, {}

    def watch_encode(*arguments):
        caught["before"] = encode(*arguments)
        return caught["before"]

    def watch_synthesise(cameras, codes, *rest):
        caught["after"] = codes
        return synthesise(cameras, codes, *rest)

    monkeypatch.setattr(trained.networks, "encode", watch_encode)
    monkeypatch.setattr(trained.networks, "synthesise", watch_synthesise)
    steps(trained, 1)
    return caught["before"], caught["after"]


def test_styles_are_permuted_within_their_sequence_and_poses_stay(monkeypatch):
    before, after = codes_before_and_after(monkeypatch, sequences=2, frames=3)
    for name, codes in before.items():
        assert torch.equal(after[name].pose, codes.pose)
        assert torch.equal(after[name].position, codes.position)
        styles, moved = codes.style.unflatten(0, (2, 3)), after[name].style.unflatten(0, (2, 3))
        for sequence in range(2):
            assert torch.equal(moved[sequence], styles[sequence][[2, 0, 1]])
        assert not torch.equal(moved, styles)


def test_styles_stay_where_permutation_is_switched_off(monkeypatch):
    before, after = codes_before_and_after(monkeypatch, permute_style=False)
    assert all(torch.equal(after[name].style, codes.style) for name, codes in before.items())


def test_frames_of_a_batch_are_neighbours_of_one_sequence_and_all_different():
    trained = phase(sequences=3, frames=4)
    torch.manual_seed(0)
    batch = trained._sample()
    numbered = CLIPS.world_from_camera.reshape(-1, 4, 4)
    rows = [
        int((numbered == pose).all(dim=(1, 2)).nonzero()[0])
        for pose in batch.cameras.world_from_camera
    ]
    length = CLIPS.images.shape[1]
    for start in range(0, 12, 4):
        sequence = rows[start : start + 4]
        assert len({row // length for row in sequence}) == 1
        assert len(set(sequence)) == 4


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_patches_lie_in_the_picture_on_the_coarsest_grid(share):
    trained = phase(player_patches=share, sequences=8)
    torch.manual_seed(0)
    windows = torch.cat([trained.patches.corners(trained._sample().boxes) for _ in range(10)])
    assert not (windows % 4).any()
    assert (windows >= 0).all()
    assert windows[:, 0].max() <= 24 - 16 and windows[:, 1].max() <= 40 - 16
    assert len(windows.unique(dim=0)) > 4


def test_patches_around_players_contain_their_middles():
    trained = phase(player_patches=1.0, patch_height=24, patch_width=16)
    torch.manual_seed(0)
    batch = trained._sample()
    corners = trained.patches.corners(batch.boxes)
    for boxes, (_, left) in zip(batch.boxes, corners.tolist(), strict=True):
        middles = (boxes[:, 0] + boxes[:, 2]) / 2
        assert ((middles > left - 4) & (middles < left + 20)).any()


class Clock:
    """Eleven seconds pass at every look."""

    def __init__(self):
        self.now = 0.0

    def monotonic(self):
        self.now += 11.0
        return self.now


EVERYTHING = {
    "density_noise": 0.5,
    "density_noise_until": 0.8,
    "octaves_until": 0.9,
    "bending_octaves_until": 0.5,
    "recoloured": 0.5,
    "patch_weights": {"player_1": 2.0},
    "patch_places": "inverse-size",
    "rates": "exponential",
    "bfloat16": True,
    "patch_height": 24,
    "patch_width": 24,
}


@pytest.mark.parametrize("minutes", [None, 1.0])
@pytest.mark.parametrize("settings", [{}, EVERYTHING], ids=["plain", "everything"])
def test_an_interrupted_and_resumed_run_equals_an_uninterrupted_one_to_the_bit(
    tmp_path, monkeypatch, settings, minutes
):
    if settings:
        vgg = str(write_vgg(tmp_path / "vgg.pth", width=1))
        settings = settings | {"perceptual": "vgg", "perceptual_weights": vgg}
    schedule = Schedule(steps=6, minutes=minutes, log_every=1, checkpoint_every=100, seed=3)
    monkeypatch.setattr(loop, "time", Clock())
    whole = phase(steps=6, **settings)
    steps_made = run(whole, tmp_path / "whole", schedule)

    def interrupt(step, _):
        if step == 3:
            os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(loop, "time", Clock())
    parts = phase(steps=6, **settings)
    assert run(parts, tmp_path / "parts", schedule, on_log=interrupt) == 3
    resumed = phase(steps=6, seed=99, **settings)
    assert run(resumed, tmp_path / "parts", schedule, resume=True) == steps_made
    wanted, found = whole.tensors(), resumed.tensors()
    assert wanted.keys() == found.keys()
    assert [n for n in wanted if not torch.equal(wanted[n], found[n])] == []


def test_a_pixel_that_is_no_number_breaks_the_step_before_it_touches_a_weight(
    tmp_path, monkeypatch
):
    trained = phase(steps=6)
    sample, count = trained._sample, iter(range(9))

    def spoiled():
        batch = sample()
        if next(count) == 2:
            batch.images[1, :, 5:, :] = NAN
        return batch

    monkeypatch.setattr(trained, "_sample", spoiled)
    seen = {}

    def remember(moment):
        seen.update({n: t.detach().clone() for n, t in trained.networks.named_parameters()})
        seen["moment"] = trained.optimiser.state_dict()["state"][0]["exp_avg"].clone()

    schedule = Schedule(steps=6, seed=7, checkpoint_every=2)
    with pytest.raises(TrainingError, match=r"step 2: .*loss.* not finite.*broken-0000002"):
        run(trained, tmp_path, schedule, on_step=remember)
    assert all(torch.equal(seen[n], p) for n, p in trained.networks.named_parameters())
    assert torch.equal(trained.optimiser.state_dict()["state"][0]["exp_avg"], seen["moment"])
    header, tensors = load_checkpoint(tmp_path / "broken-0000002.safetensors")
    assert (header["step"], header["seed"], header["figures"]["loss"]) == (2, 7, "nan")
    assert tensors["images"].isnan().flatten(1).any(dim=1).tolist() == [False, True, False, False]
    shapes = {name: tuple(each.shape) for name, each in tensors.items() if name != "images"}
    assert shapes == {
        "boxes": (4, 2, 4),
        "corners": (4, 2),
        "intrinsics": (4, 3, 3),
        "world_from_camera": (4, 4, 4),
    }
    torch.manual_seed(7 * 1_000_003 + 2)
    again = sample()
    assert torch.equal(again.boxes, tensors["boxes"])
    assert load_checkpoint(tmp_path / "checkpoint.safetensors")[0]["step"] == 2


def test_a_gradient_that_is_not_finite_breaks_the_step_as_well():
    trained = phase()
    output = trained.networks.fields["ground"].output.weight
    output.register_hook(lambda gradient: gradient * NAN)
    before = output.detach().clone()
    with pytest.raises(BrokenStepError, match="gradient is not finite"):
        steps(trained, 1)
    assert torch.equal(output, before)


def test_noise_on_densities_falls_to_none_where_it_should():
    fixed, falling = phase(density_noise=2.0), phase(density_noise=2.0, density_noise_until=0.5)
    assert [fixed._noise(p) for p in (0.0, 0.9)] == [2, 2]
    assert [falling._noise(p) for p in (0.0, 0.25, 0.5, 0.9)] == [2, 1, 0, 0]


def test_the_learning_rates_that_are_asked_for_are_taken():
    (log,) = steps(phase(rates="constant", warmup=0, steps=10), 1, start=9)
    assert log["rate"] == pytest.approx(2e-3)
    (log,) = steps(phase(rates="exponential", last_rate=0.1, warmup=0, steps=10), 1, start=5)
    assert log["rate"] == pytest.approx(2e-3 * 0.1**0.5)


def test_a_sheet_shows_target_drawn_and_drawn_with_another_pose():
    trained = phase(held_out=CLIPS)
    assert trained.sheet() is None
    trained.evaluate()
    sheet, gap = trained.sheet(), 2
    rows = 3 * 2
    assert sheet.shape == (rows * (24 + gap) - gap, 3 * (40 + gap) - gap, 3)
    target = CLIPS.images[1, 3].float() / 255
    bottom = sheet[-24:]
    torch.testing.assert_close(bottom[:, :40], target)
    drawn, swapped = bottom[:, 42:82], bottom[:, 84:]
    assert not torch.equal(drawn, target)
    assert not torch.equal(drawn, swapped)


def test_measurements_say_how_good_whole_frames_and_player_boxes_are():
    figures = phase(held_out=CLIPS).evaluate()
    assert set(figures) == {"psnr", "psnr_box", "psnr_box_other_pose"}
    assert all(0 < value < 60 for value in figures.values())
    assert phase(held_out=None).evaluate() == {}


def test_measuring_changes_neither_weights_nor_running_means():
    trained = phase(held_out=CLIPS)
    before = {n: t.clone() for n, t in trained.tensors().items()}
    trained.evaluate()
    assert all(torch.equal(before[n], t) for n, t in trained.tensors().items())


def test_frames_without_players_are_measured_without_their_boxes():
    assert set(phase(held_out=without_boxes((slice(None),))).evaluate()) == {"psnr"}


@pytest.mark.parametrize("edges", [(50.0, 60.0), (-9.0, -2.0), (5.1, 5.3)])
def test_a_box_that_covers_no_pixel_does_not_spoil_the_measurement(edges):
    boxes = CLIPS.boxes.clone()
    boxes[0, 0, 0, [0, 2]] = torch.tensor(edges)
    figures = phase(held_out=replace(CLIPS, boxes=boxes)).evaluate()
    assert all(0 < value < 60 for value in figures.values())


def test_a_whole_training_writes_its_model_its_settings_and_its_metrics(tmp_path):
    config, told = small_config(width=40, height=24), []
    networks = train_synthesis(
        (config, small_training(steps=3)),
        (CLIPS, None),
        tmp_path,
        RunOptions(on_log=lambda step, figures: told.append(step)),
    )
    assert told == [3]
    assert (tmp_path / METRICS).exists()
    settings = json.loads((tmp_path / "config.json").read_text())
    assert settings["synthesis"]["steps"] == 3
    header, tensors = load_checkpoint(tmp_path / "synthesis.safetensors")
    assert (header["kind"], header["steps"], "envelope" in header) == ("synthesis", 3, True)
    again = SynthesisNetworks(config)
    load_synthesis(again, tensors)
    assert all(
        torch.equal(a, b)
        for a, b in zip(again.state_dict().values(), networks.state_dict().values(), strict=True)
    )


def test_training_can_start_from_another_model_s_weights(tmp_path):
    config = small_config(width=40, height=24)
    torch.manual_seed(5)
    source = SynthesisNetworks(config)
    save_checkpoint(tmp_path / "start.safetensors", prefixed(source), {"kind": "synthesis"})
    settings = (config, small_training(steps=0))
    options = RunOptions(start_from=tmp_path / "start.safetensors")
    started = train_synthesis(settings, (CLIPS, None), tmp_path / "run", options)
    assert torch.equal(
        started.fields["player"].output.weight, source.fields["player"].output.weight
    )


def test_weights_of_another_architecture_are_refused():
    other = SynthesisNetworks(small_config(style_features=9))
    with pytest.raises(CheckpointError, match="misshapen"):
        load_synthesis(SynthesisNetworks(small_config()), prefixed(other))


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"frames": 99}, "frames"),
        ({"patch_width": 18}, "multiple of 4"),
        ({"patch_height": 640}, "at most"),
    ],
)
def test_patches_and_frames_that_the_data_do_not_have_are_refused(changes, told):
    with pytest.raises(ConfigError, match=told):
        phase(**changes)
