"""A whole benchmark of a tiny model: its processes, report, tables and plots."""

import json

import pytest
import tiny_model
from command_line import run

from pe_runtime.benchmark import report as bench_report
from pe_runtime.benchmark.jobs import Case, Job, carry_out
from pe_runtime.benchmark.plan import BLENDER, OF_MODELS, SECTIONS, Plan, quick
from pe_runtime.benchmark.plots import spaced
from pe_runtime.benchmark.points import all_points
from pe_runtime.benchmark.processes import BenchmarkError, measure
from pe_runtime.benchmark.report import MEASURES, plan_steps, run_benchmark
from pe_runtime.benchmark.results import write_results
from pe_runtime.benchmark.tables import as_markdown, milliseconds, sheets
from pe_runtime.config import QUALITIES
from pe_runtime.contract.errors import ConfigError

SPREAD = {"median", "low", "high", "count"}
ERROR = {"max_abs", "rmse", "psnr", "perceptual"}


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return tiny_model.write_model(tmp_path_factory.mktemp("model") / "tiny.safetensors")


def tiny_plan(model, **changes):
    given = {
        "models": (model,),
        "sections": OF_MODELS,
        "frames": 3,
        "repeats": 2,
        "long_film": 12,
        "finer": 2,
    }
    return Plan(**given | {"product_rows": 64, "object_rounds": 1} | changes)


@pytest.fixture(scope="module")
def jobs():
    return []


@pytest.fixture(scope="module")
def report(model, jobs):
    """All sections, measured in this process; `jobs` are what would have been processes."""

    def here(job):
        jobs.append(job)
        return carry_out(job)

    seen = []
    found = run_benchmark(tiny_plan(model), lambda *step: seen.append(step), here)
    assert seen == [(number, len(jobs)) for number in range(len(jobs) + 1)]
    return found


@pytest.fixture(scope="module")
def about(report):
    return report["models"][0]


def test_a_report_is_json_and_says_what_was_measured_where(report, about):
    assert json.loads(json.dumps(report, allow_nan=False)) == report
    assert report["format"] == 1
    assert report["plan"]["repeats"] == 2
    assert report["machine"]["gflops_float32"] >= 0
    assert (about["model"], about["width"], about["height"]) == ("tiny", 32, 16)
    assert (about["quadrature"], about["object_count"], about["player_count"]) == ("interval", 3, 2)


def test_every_point_has_times_errors_memory_and_a_machine(about):
    assert [each["name"] for each in about["points"]] == [p.name for p in all_points()]
    for each in about["points"]:
        assert set(each["seconds"]) == {"cold", "first", "moving", "standing", "still"}
        counts = {name: found["count"] for name, found in each["seconds"].items()}
        # Two runs of three films of three frames.
        assert counts == {"cold": 2, "first": 6, "moving": 4, "standing": 4, "still": 4}
        assert all(set(found) == SPREAD for found in each["seconds"].values())
        assert set(each["errors"]) == {"float64", "converged"}
        assert all(set(found) == ERROR for found in each["errors"].values())
        assert set(each["memory"]) == {"loaded", "peak", "gpu"}
        assert each["machine"].keys() >= {"processor", "cores", "threads", "torch", "bfloat16"}
        # Plain modules count nothing.
        assert (each["statistics"]["moving"].get("rays", 0) > 0) == (each["kind"] != "baseline")


def test_exact_is_within_1e_5_of_float64_in_every_film_and_other_presets_are_not(about):
    errors = {each["name"]: each["errors"]["float64"] for each in about["points"]}
    assert max(errors[name]["max_abs"] for name in ("exact", "plain")) <= 1e-5
    assert errors["draft"]["max_abs"] > 1e-5


def test_points_are_measured_in_turn(jobs):
    asked = [job.cases[0].quality for job in jobs if job.cases[0].kept and job.rounds == 1]
    qualities = [point.quality for point in all_points()]
    assert asked == qualities + qualities[1:] + qualities[:1]


def test_costs_are_measured_over_pixels_objects_samples_and_frames(about):
    for name in ("exact", "balanced"):
        sizes = about["pixels"][name]["sizes"]
        pixels = [each["pixels"] for each in sizes]
        assert pixels == sorted(set(pixels)) and len(pixels) == 5
        assert isinstance(about["pixels"][name]["slope"], float)
    casts = {(each["cast"], each["count"]) for each in about["objects"]}
    assert {("absent", 0), ("hidden", 0), ("out of view", 10), ("in view", 10)} <= casts
    usual = next(each for each in about["objects"] if each["cast"] == "as found")
    assert usual["relative"] == 1.0
    errors = [each["converged"]["rmse"] for each in about["samples"]]
    assert errors[0] > errors[1] > errors[2] * 0.999
    for each in about["frames"]:
        assert each["frames"] == 12
        assert list(each["memory"]) in (["1", "10", "12"], [])


def test_hidden_objects_cost_no_evaluation(about):
    work = {(e["cast"], e["count"]): e["statistics"] for e in about["objects"]}
    assert work["hidden", 0] == work["absent", 0]
    assert work["more hidden", 10] == work["as found", 0] == work["out of view", 10]
    assert work["in view", 10]["field_samples"] > work["as found", 0]["field_samples"]


def test_results_are_json_markdown_and_two_plots(report, tmp_path):
    written = write_results(report, tmp_path / "out")
    plots = ["benchmark_error.png", "benchmark_cost.png"]
    names = ["benchmark.json", "benchmark_tables.md", *plots]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == sorted(names)
    assert [path.name for path in written] == names
    assert json.loads(written[0].read_text()) == report
    for plot in written[2:]:
        assert plot.read_bytes().startswith(b"\x89PNG")
        assert plot.stat().st_size > 10_000


def test_tables_have_a_row_per_point_and_name_the_machine(report):
    made = sheets(report)
    assert [row[0] for row in made[0].rows] == [point.name for point in all_points()]
    assert all(len(row) == len(each.headings) for each in made for row in each.rows)
    assert report["machine"]["processor"] in made[0].caption
    text = as_markdown(report)
    for name in QUALITIES:
        assert f"| {name} |" in text


def test_a_time_is_written_with_its_spread():
    seconds = {"median": 0.0712, "low": 0.0703, "high": 0.0721, "count": 9}
    assert milliseconds(seconds) == "71.2 ±0.9"
    assert milliseconds({"median": 1.234, "low": 1.2, "high": 1.3, "count": 3}) == "1234 ±50"


def test_close_labels_are_pushed_apart_and_others_left_alone():
    assert spaced([0.50, 0.51], 0.05) == pytest.approx([0.48, 0.53])
    assert spaced([0.9, 0.1], 0.05) == [0.9, 0.1]
    placed = spaced([0.2, 0.2, 0.2, 0.24, 0.8], 0.05)
    ordered = sorted(placed)
    assert all(b - a >= 0.05 - 1e-9 for a, b in zip(ordered, ordered[1:], strict=False))
    assert spaced([], 0.1) == []


def test_only_the_sections_asked_for_are_measured(model, tmp_path):
    found = run_benchmark(tiny_plan(model, sections=("samples",)), by=carry_out)
    assert set(found["models"][0]) & set(SECTIONS) == {"samples"}
    names = [path.name for path in write_results(found, tmp_path)]
    assert names == ["benchmark.json", "benchmark_tables.md", "benchmark_cost.png"]


def test_an_unknown_section_is_refused_before_anything_is_measured(model):
    with pytest.raises(ConfigError, match="no section 'speed'"):
        run_benchmark(tiny_plan(model, sections=("speed",)), by=pytest.fail)


def test_every_section_has_a_measure_and_a_number_of_processes():
    assert tuple(MEASURES) == OF_MODELS
    assert (*OF_MODELS, BLENDER) == SECTIONS == tuple(plan_steps(Plan()))


@pytest.mark.parametrize(
    "section",
    [
        {"limit_ms": 15.0, "width": 512, "height": 288, "skipped": "no Blender here"},
        {
            **{"limit_ms": 15.0, "width": 512, "height": 288, "model": "fake"},
            **{"quality": "exact", "blender": "5.0.1", "overhead_ms": 6.5},
            "costs": [
                {
                    **{"way": "still", "passes": ["depth"], "frames": 8, "overhead": 6.5},
                    **{"quartiles": [6.0, 7.0], "drawing": 3.0, "parts": {"pipe": 1.25}},
                }
            ],
        },
    ],
)
def test_the_path_through_blender_is_measured_once_and_shown(monkeypatch, model, section):
    monkeypatch.setattr(bench_report, "blender_path_section", lambda job: section)
    steps = []
    plan = tiny_plan(model, sections=(BLENDER,))
    found = run_benchmark(plan, lambda *step: steps.append(step), by=pytest.fail)
    assert steps == [(0, 1), (1, 1)]
    assert found["blender"] == section
    text = as_markdown(found)
    assert "no Blender here" in text or "| still, 1 more passes | 6.5 | 3.0 | 1.2 |" in text


def test_a_model_without_players_has_no_cost_of_objects(tmp_path):
    lonely = tiny_model.write_model(tmp_path / "lonely.safetensors", players=())
    found = run_benchmark(tiny_plan(lonely, sections=("objects",)), by=carry_out)
    assert found["models"][0]["objects"] == []


def test_rounds_are_interleaved_and_every_run_starts_without_memory(model):
    cases = (Case("a", film="still", frames=2), Case("b", film="still", frames=2, kept=(1,)))
    found = carry_out(Job(model, None, "cpu", cases, rounds=2, product_rows=64))
    assert [each.case for each in found.runs] == ["a", "b", "b", "a"]
    assert all(len(each.seconds) == 2 for each in found.runs)
    assert list(found.pictures) == ["b/1"]


def test_a_job_gives_the_same_pictures_in_a_process_of_its_own(model):
    case = Case("film", QUALITIES["draft"], "moving", 2, 24, 12, kept=(0, 1))
    job = Job(model, None, "cpu", (case,), product_rows=64)
    alone, here = measure(job), carry_out(job)
    assert [run.case for run in alone.runs] == ["film"]
    assert alone.runs[0].statistics == here.runs[0].statistics
    for key, picture in here.pictures.items():
        assert abs(alone.pictures[key] - picture).max() <= 1e-6


def test_a_process_that_fails_says_why():
    with pytest.raises(BenchmarkError, match="no model 'nothing'"):
        measure(Job("nothing", None, "cpu", (Case("a"),), product_rows=64))


def test_quick_is_smaller_in_every_way_but_keeps_what_was_asked_for():
    plan = Plan(models=("mine",), sections=("pixels",))
    small = quick(plan)
    assert (small.models, small.sections) == (plan.models, plan.sections)
    assert small.frames < plan.frames and small.repeats < plan.repeats
    assert quick(Plan()).models == ("duel",)
    assert BLENDER not in quick(Plan()).sections
    assert quick(Plan(sections=(BLENDER,))).sections == (BLENDER,)


def test_pe_bench_prints_a_table_and_writes_its_files(capsys, model, tmp_path):
    options = ("--model", model, "--quick", "--only", "pixels", "--out", tmp_path / "out")
    code, out, err = run(capsys, "bench", *options)
    assert (code, err) == (0, "")
    assert "cost of pixels" in out
    found = json.loads((tmp_path / "out" / "benchmark.json").read_text())
    assert found["models"][0]["model"] == "tiny"


def test_pe_bench_refuses_an_unknown_section_in_one_line(capsys, model, tmp_path):
    options = ("--model", model, "--only", "speed", "--out", tmp_path)
    code, _, err = run(capsys, "bench", *options)
    assert code == 1
    assert err.count("\n") == 1 and "no section 'speed'" in err
