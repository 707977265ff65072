"""The evaluation, on a toy world whose right figures are known."""

import io
import json
import math

import numpy as np
import pytest
from rich.console import Console
from toy_world import FRAMES, STEPS, ToyEnvironment, find_cards, plain, record

from pe_runtime.contract.errors import EpisodeError
from pe_runtime.evaluation import confidence
from pe_runtime.evaluation.protocol import evaluate
from pe_runtime.evaluation.tables import FIGURES, as_json, as_table


@pytest.fixture(scope="module", autouse=True)
def few_resamples():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(confidence, "RESAMPLES", 20)
        yield


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    return record(tmp_path_factory.mktemp("toy"), sequences=8)


@pytest.fixture(scope="module")
def report(recordings, few_resamples):
    return evaluate(ToyEnvironment(), recordings, silhouette=find_cards)


def value(report, name):
    return report["figures"][name]["value"]


def test_a_model_that_makes_no_mistake_gets_the_best_figures(report):
    assert value(report, "reconstruction_psnr") > 50
    assert value(report, "reconstruction_ssim") > 0.99
    assert value(report, "novel_view_psnr") > 50
    assert abs(value(report, "novel_view_drop")) < 5
    assert value(report, "delta_mse") == pytest.approx(0, abs=1e-9)
    assert value(report, "delta_accuracy") > 90
    assert value(report, "action_agreement") == pytest.approx(1)
    assert value(report, "rollout_error_last") < 1e-3
    assert value(report, "encoding_error") < 1e-3


def test_every_figure_is_measured_and_has_a_unit_and_an_interval(report):
    # The toy's players have one way of standing: there is nothing to tell apart.
    assert list(report["figures"]) == list(FIGURES)
    told = dict(report["figures"])
    lone = told.pop("standing_accuracy")
    assert math.isnan(lone["value"])
    for figure in told.values():
        assert figure["low"] <= figure["value"] <= figure["high"]
        assert figure["sequences"] == 8
        assert "unit" in figure


def test_the_pose_of_another_frame_costs_a_model_that_draws_poses(report):
    gap = value(report, "box_psnr_pose_gap")
    assert gap > 10
    own, other = value(report, "box_psnr_own_pose"), value(report, "box_psnr_other_pose")
    assert gap == pytest.approx(own - other)


def test_a_model_that_ignores_poses_shows_no_gap(recordings):
    blind = evaluate(ToyEnvironment(pose_is_drawn=False), recordings)
    assert value(blind, "box_psnr_pose_gap") == 0


def test_poses_and_styles_of_another_sequence_show_and_leave_the_cards_where_they_are(report):
    assert value(report, "other_sequence_pose_psnr_gap") > 10
    assert value(report, "other_sequence_pose_change") > 5
    assert value(report, "style_swap_colour") > 2
    assert value(report, "style_swap_iou") == 1
    assert value(report, "style_swap_silhouette_iou") == 1
    assert value(report, "other_sequence_pose_iou") == 1


def test_a_single_sequence_has_no_other_to_borrow_from(tmp_path):
    report = evaluate(ToyEnvironment(), record(tmp_path, sequences=1))
    assert "style_swap_iou" not in report["figures"]
    assert value(report, "box_psnr_pose_gap") > 10


def test_a_model_without_fields_has_no_shift_to_take_out_of_its_poses(report):
    gap = value(report, "box_psnr_pose_gap")
    assert value(report, "box_psnr_articulation_gap") == pytest.approx(gap)


def test_a_model_without_players_is_measured_by_its_pictures(recordings):
    report = evaluate(ToyEnvironment(playable_names=(), actions={}), recordings)
    assert set(report["figures"]) == {
        "reconstruction_psnr",
        "reconstruction_ssim",
        "novel_view_psnr",
        "novel_view_ssim",
        "novel_view_drop",
    }
    assert value(report, "reconstruction_psnr") < 30


def test_standing_still_is_measured_against_the_true_walk(report, recordings):
    tracks = [np.load(p / "arrays.npz")["positions"] for p in sorted(recordings.glob("0*"))]
    walked = [np.linalg.norm((p[-1] - p[0])[:, :2], axis=-1).mean() for p in tracks]
    assert value(report, "static_error_last") == pytest.approx(np.mean(walked), abs=1e-3)
    by_step = report["error_by_step"]
    assert len(by_step["static"]) == len(by_step["rollout"]) == FRAMES
    assert by_step["static"][-1] == pytest.approx(value(report, "static_error_last"))


def test_drift_in_the_dynamics_adds_up_over_the_rollout(recordings):
    report = evaluate(ToyEnvironment(drift=0.1), recordings)
    steps = np.diff(report["error_by_step"]["rollout"])
    # A tenth of a metre a step; the camera turns, so the last one adds a little less.
    np.testing.assert_allclose(steps, 0.1, atol=0.01)
    assert value(report, "rollout_error_last") == pytest.approx(0.1 * (FRAMES - 1), abs=0.02)


def test_a_model_that_always_sees_the_same_action_explains_nothing(recordings):
    report = evaluate(ToyEnvironment(always=0), recordings)
    assert value(report, "delta_mse") == pytest.approx(100)
    assert value(report, "action_agreement") == pytest.approx(0, abs=1e-9)
    assert value(report, "delta_mse_of_true_actions") == pytest.approx(0, abs=1e-9)
    expected = value(report, "static_error_last")
    assert value(report, "rollout_error_last") == pytest.approx(expected, abs=1e-3)
    assert not STEPS[0].any()


def test_a_model_without_trained_actions_is_measured_by_its_pictures(recordings):
    report = evaluate(ToyEnvironment(actions={}), recordings)
    assert "delta_mse" not in report["figures"]
    assert report["moving_sequences"] == 0
    assert report["error_by_step"] == {"rollout": [], "static": []}
    assert value(report, "reconstruction_psnr") > 50


def test_one_recorded_view_leaves_the_novel_view_out(tmp_path):
    report = evaluate(ToyEnvironment(), record(tmp_path, sequences=2, views=1))
    assert "novel_view_psnr" not in report["figures"]
    assert value(report, "reconstruction_psnr") > 50


def test_sequences_that_lose_a_player_are_drawn_but_not_followed(tmp_path):
    root = record(tmp_path, sequences=3, absent=[(1, 2, "left")])
    report = evaluate(ToyEnvironment(), root, every=1)
    assert report["sequences"] == 3
    assert report["moving_sequences"] == 2
    assert report["frames"] == 3 * FRAMES
    assert value(report, "reconstruction_psnr") > 50


def test_sequences_of_a_single_frame_have_no_motion(tmp_path):
    report = evaluate(ToyEnvironment(), record(tmp_path, sequences=2, frames=1))
    assert report["moving_sequences"] == 0
    assert "delta_mse" not in report["figures"]
    assert value(report, "box_psnr_pose_gap") == 0


def test_limit_and_every_say_how_much_is_drawn_and_progress_counts(recordings):
    seen = []
    report = evaluate(
        ToyEnvironment(), recordings, limit=2, every=4, progress=lambda *at: seen.append(at)
    )
    assert (report["sequences"], report["frames"]) == (2, 4)
    assert seen == [(1, 2), (2, 2)]


def test_a_data_set_without_episodes_is_refused(tmp_path):
    root = record(tmp_path, sequences=0)
    with pytest.raises(EpisodeError, match="no complete episode"):
        evaluate(ToyEnvironment(), root)


def test_a_data_set_of_other_players_is_refused_by_name(recordings):
    with pytest.raises(EpisodeError, match="shows right; the model's players are left"):
        evaluate(ToyEnvironment(playable_names=("left",)), recordings)


def test_the_report_is_json_and_a_table(report):
    told = {n: f for n, f in report["figures"].items() if not math.isnan(f["value"])}
    stored = json.loads(as_json(report))
    assert stored["figures"].pop("standing_accuracy")["value"] is None
    assert stored == plain(report | {"figures": told})
    console = Console(width=120, record=True, file=io.StringIO())
    console.print(as_table(report))
    text = console.export_text()
    assert "toy: 8 sequences, 16 frames drawn" in text
    for label, _ in FIGURES.values():
        assert label in text


def test_what_could_not_be_measured_is_null_in_json_and_a_dash_in_the_table(report):
    figure = {"value": math.nan, "low": math.nan, "high": math.nan, "sequences": 0, "unit": "dB"}
    lost = report | {"figures": {"reconstruction_psnr": figure}}
    assert json.loads(as_json(lost))["figures"]["reconstruction_psnr"]["value"] is None
    assert list(as_table(lost).columns[1].cells) == ["-"]
