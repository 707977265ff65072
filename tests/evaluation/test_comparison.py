"""Rows of the paper's tables, on the toy world whose right figures are known."""

import json
import math

import pytest
from toy_world import FRAMES, ToyEnvironment, find_cards, record

from pe_runtime.contract.errors import ConfigError, EpisodeError
from pe_runtime.evaluation import confidence
from pe_runtime.evaluation.comparison import TABLES, Contender, measure_rows
from pe_runtime.evaluation.detector_network import component_boxes
from pe_runtime.evaluation.instruments import Instruments, set_up
from pe_runtime.evaluation.paper_figures import COLUMNS
from pe_runtime.evaluation.rules import FILE, RULES, stated_rules


class CardDetector:
    """Finds cards as components of what is not background."""

    name = "cards"

    def __call__(self, picture):
        return component_boxes(find_cards(picture))


@pytest.fixture(scope="module", autouse=True)
def few_resamples():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(confidence, "RESAMPLES", 10)
        yield


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    return record(tmp_path_factory.mktemp("toy"), sequences=4)


def measured(recordings, table, instruments=None, **toys):
    rows = [Contender(name, lambda toy=toy: toy) for name, toy in toys.items()]
    return measure_rows(rows, recordings, table, instruments or Instruments(CardDetector()))


def value(row, name):
    return row["figures"][name]["value"]


# The toy's dynamics leave a card's grey as it was, so what is played is not what was recorded.
@pytest.mark.parametrize(
    ("table", "worst"), [("reconstruction", 50), ("playability", 15), ("camera", 15)]
)
def test_a_perfect_model_is_perfect_in_all_three_protocols(recordings, table, worst):
    row = measured(recordings, table, toy=ToyEnvironment())["toy"]
    assert value(row, "psnr") > worst
    assert value(row, "mdr") == 0
    assert value(row, "add") < 0.1
    assert row["sequences"] == 4
    assert len(row["add_by_step"]) == FRAMES


def test_only_what_rolls_out_shows_a_mistake_of_the_dynamics(recordings):
    drifting = ToyEnvironment(drift=0.1)
    still = measured(recordings, "reconstruction", toy=drifting)["toy"]
    played = measured(recordings, "playability", toy=drifting)["toy"]
    assert value(still, "add") < 0.1
    assert value(played, "add") > 0.5
    assert played["add_by_step"][0] < 0.1
    assert played["add_by_step"] == sorted(played["add_by_step"])
    assert value(played, "add_of_width_last") == pytest.approx(played["add_by_step"][-1])
    assert value(played, "psnr") < value(still, "psnr")


def test_rows_are_measured_in_order_and_by_their_actions(recordings):
    rows = measured(
        recordings, "playability", good=ToyEnvironment(), blind=ToyEnvironment(always=0)
    )
    assert list(rows) == ["good", "blind"]
    assert value(rows["good"], "delta_mse") == pytest.approx(0, abs=1e-9)
    assert value(rows["blind"], "delta_mse") == pytest.approx(100)
    assert value(rows["blind"], "add") > value(rows["good"], "add")


def test_a_model_that_draws_nobody_misses_everybody(recordings):
    nobody = ToyEnvironment(playable_names=(), actions={})
    row = measured(recordings, "reconstruction", plain=nobody)["plain"]
    assert value(row, "mdr") == 100
    assert math.isnan(value(row, "add"))
    assert value(row, "fd_r") > 0


def test_a_model_without_actions_has_no_playability_and_says_so_at_the_camera(recordings):
    frozen = ToyEnvironment(actions={})
    with pytest.raises(ConfigError, match="pe train actions"):
        measured(recordings, "playability", toy=frozen)
    row = measured(recordings, "camera", toy=frozen)["toy"]
    assert row["note"] == "no actions: every frame's own state"
    assert measured(recordings, "camera", toy=ToyEnvironment())["toy"]["note"] == ""


def test_one_view_has_no_camera_table(tmp_path):
    root = record(tmp_path, sequences=2, views=1)
    with pytest.raises(EpisodeError, match="a second view"):
        measured(root, "camera", toy=ToyEnvironment())


def test_masks_of_the_model_can_stand_in_for_a_detector(recordings):
    row = measured(recordings, "playability", set_up("masks"), toy=ToyEnvironment())["toy"]
    assert value(row, "mdr") == 0
    # The recorder's boxes are exact to a fraction of a pixel, masks to whole ones.
    assert value(row, "add") < 1


def test_without_a_detector_its_columns_are_left_out(recordings):
    row = measured(recordings, "reconstruction", set_up("none"), toy=ToyEnvironment())["toy"]
    assert {"add", "mdr"}.isdisjoint(row["figures"])
    assert row["add_by_step"] == []


def test_every_figure_has_a_column_an_interval_and_a_unit(recordings):
    row = measured(recordings, "playability", toy=ToyEnvironment(drift=0.05))["toy"]
    assert set(row["figures"]) == set(COLUMNS) - {"lpips", "fid"}
    for figure in row["figures"].values():
        assert figure["low"] <= figure["high"]
    assert row["figures"]["add"]["unit"] == "px"


def test_progress_counts_sequences_and_models_load_one_after_the_other(recordings):
    seen, loaded = [], []

    def load(name):
        loaded.append(name)
        return ToyEnvironment()

    rows = [Contender("a", lambda: load("a")), Contender("b", lambda: load("b"))]
    instruments = Instruments()
    measure_rows(
        rows, recordings, "reconstruction", instruments, 2, lambda *at: seen.append((*at, *loaded))
    )
    assert seen == [(1, 2, "a"), (2, 2, "a"), (1, 2, "a", "b"), (2, 2, "a", "b")]


def test_an_unknown_detector_is_refused_by_name():
    with pytest.raises(ConfigError, match="own, hog, masks, none, found 'yolo'"):
        set_up("yolo")


def test_detectors_have_the_names_that_reports_give():
    assert [set_up(name).detector_name for name in ("own", "hog", "masks", "none")] == [
        "own",
        "hog",
        "masks",
        "none",
    ]


def test_the_protocol_is_stated_with_its_hash():
    import hashlib

    stated = stated_rules()
    assert stated["hash"] == hashlib.sha256(FILE.read_bytes()).hexdigest()[:12]
    assert stated["rules"]["clip"] == RULES.clip
    assert json.dumps(stated)


def test_every_table_has_a_protocol():
    assert set(TABLES.values()) == {"reconstruction", "playability", "camera", "long-play"}
