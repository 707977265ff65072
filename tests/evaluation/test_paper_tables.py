"""Layout of the paper's tables, and the rows that a folder of runs gives."""

import json
import math

import pytest

from pe_runtime.contract.errors import ConfigError
from pe_runtime.evaluation.contenders import contenders_of, fitting_tables, run_files
from pe_runtime.evaluation.paper_tables import (
    as_markdown,
    as_rich,
    headings_and_rows,
    notes,
    write_report,
)


def figure(value):
    return {"value": value, "low": value - 1, "high": value + 1, "sequences": 3, "unit": ""}


def row(note="", **values):
    return {
        "figures": {name: figure(value) for name, value in values.items()},
        "sequences": 3,
        "note": note,
    }


def report(**tables):
    return {
        "scene": "toy",
        "sequences": 3,
        "detector": "own",
        "protocol": {"hash": "0123456789ab"},
        "tables": tables,
    }


def test_columns_stand_in_the_papers_order_and_only_where_something_was_measured():
    rows = {"one": row(mdr=1.0, lpips_r=0.25, delta_mse=12.0), "two": row(lpips_r=0.5)}
    headings, body = headings_and_rows("playability", rows)
    assert headings == ["", "LPIPS-R↓", "Δ-MSE↓", "MDR↓"]
    assert body == [["one", "0.250", "12.00", "1.000"], ["two", "0.500", "-", "-"]]


def test_the_synthesis_ablation_has_the_papers_letters_and_ticks():
    names = ("plain", "multi", "multi-pose", "concatenation", "single-resolution", "full")
    headings, body = headings_and_rows("ablation-synthesis", {n: row(add=1.0) for n in names})
    assert headings == ["Var.", "Multi", "π", "w", "F", "ADD↓"]
    assert [cells[:5] for cells in body] == [
        ["(a) plain", "", "", "", ""],
        ["(b) multi", "✓", "", "", ""],
        ["(c) multi-pose", "✓", "✓", "", ""],
        ["(d) concatenation", "✓", "✓", "~", ""],
        ["(f) single-resolution", "✓", "✓", "✓", "~"],
        ["full", "✓", "✓", "✓", "✓"],
    ]


def test_the_action_ablation_has_the_papers_ticks():
    headings, body = headings_and_rows("ablation-actions", {n: row(add=1.0) for n in "ABCDE"})
    assert headings[:5] == ["Var.", "Rel.", "D", "L_Δ", "L_act"]
    assert [cells[:5] for cells in body] == [
        ["A", "", "", "", "✓"],
        ["B", "✓", "", "", "✓"],
        ["C", "✓", "", "✓", "✓"],
        ["D", "✓", "✓", "", "✓"],
        ["E", "✓", "✓", "✓", ""],
    ]


def test_a_row_that_the_paper_does_not_have_gets_no_ticks():
    _, body = headings_and_rows("ablation-synthesis", {"mine": row(add=2.0)})
    assert body == [["mine", "", "", "", "", "2.000"]]


def test_long_play_stands_on_its_side_with_intervals():
    headings, body = headings_and_rows(
        "long-play", {"duel": row(finite=100.0, liveliness=math.nan)}
    )
    assert headings == ["figure", "duel", "unit"]
    assert body[0] == ["States and pictures that are finite", "100.00 [99.00, 101.00]", "%"]
    assert body[-1][1] == "-"


def test_notes_say_what_stand_ins_are_and_what_a_row_could_not_do():
    found = notes("camera", {"frozen": row("no actions", fd_r=1.0, psnr=20.0)})
    assert found[0] == "frozen: no actions"
    assert any(line.startswith("FD-R:") for line in found)
    assert not any("FVD-R" in line for line in found)
    assert found[-1] == "PSNR in dB"


def test_a_stand_in_never_bears_the_name_of_what_it_stands_in_for():
    headings, _ = headings_and_rows("camera", {"a": row(lpips_r=1.0, fd_r=1.0, fvd_r=1.0)})
    assert {"LPIPS↓", "FID↓", "FVD↓"}.isdisjoint(headings)


def test_a_report_is_written_as_json_and_as_a_table(tmp_path):
    made = report(playability={"duel": row(add=1.5, fvd_r=math.nan)})
    write_report(made, tmp_path / "new")
    stored = json.loads((tmp_path / "new" / "report.json").read_text())
    assert stored["protocol"]["hash"] == "0123456789ab"
    assert stored["tables"]["playability"]["duel"]["figures"]["fvd_r"]["value"] is None
    text = (tmp_path / "new" / "table.md").read_text()
    assert text == as_markdown(made)
    assert "|  | FVD-R↓ | ADD↓ |" in text
    assert "| duel | - | 1.500 |" in text
    assert sorted(path.name for path in (tmp_path / "new").iterdir()) == ["report.json", "table.md"]


def test_the_terminal_shows_the_same_cells():
    rows = {"duel": row(add=1.5)}
    view = as_rich("camera", rows, "toy: camera")
    assert view.title == "toy: camera"
    assert [list(column.cells) for column in view.columns] == [["duel"], ["1.500"]]


@pytest.fixture
def runs(tmp_path):
    for name, file in (
        ("full", "synthesis.safetensors"),
        ("plain", "synthesis.safetensors"),
        ("B", "model.safetensors"),
        ("A", "model.safetensors"),
        ("extra", "model.safetensors"),
    ):
        (tmp_path / name).mkdir()
        (tmp_path / name / file).write_bytes(b"")
    (tmp_path / "empty").mkdir()
    return tmp_path


def test_runs_of_an_ablation_stand_in_the_papers_order(runs):
    assert list(run_files(runs, "ablation-synthesis")) == ["plain", "full"]
    assert list(run_files(runs, "ablation-actions")) == ["A", "B"]
    assert list(run_files(runs, "reconstruction")) == ["A", "B", "extra", "full", "plain"]
    assert list(run_files(runs, "playability")) == ["A", "B", "extra"]


def test_a_whole_model_goes_before_its_synthesis_module(runs):
    (runs / "full" / "model.safetensors").write_bytes(b"")
    assert run_files(runs, "reconstruction")["full"].name == "model.safetensors"


def test_all_tables_of_a_folder_are_those_that_its_runs_can_fill(runs):
    assert fitting_tables("all", runs, "unused") == [
        "reconstruction",
        "playability",
        "camera",
        "ablation-synthesis",
        "ablation-actions",
        "long-play",
    ]


def test_a_folder_without_runs_and_an_unknown_table_are_refused(tmp_path):
    with pytest.raises(ConfigError, match="named A, B, C, D, E, full"):
        contenders_of("ablation-actions", tmp_path, "unused")
    with pytest.raises(ConfigError, match="no folder"):
        fitting_tables("all", tmp_path, "unused")
    with pytest.raises(ConfigError, match="table must be one of"):
        contenders_of("gallery", None, "duel")
