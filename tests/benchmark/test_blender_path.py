"""The measurement of the path through Blender: what it times, and what it says where it cannot."""

import dataclasses
import json
import sys

import numpy as np
import pytest

from pe_runtime.benchmark import blender_path
from pe_runtime.benchmark.blender_path import (
    PARTS,
    BlenderPathError,
    PathJob,
    blender_path_section,
    measure,
)
from pe_runtime.contract.errors import PlayableEnvironmentError

SMALL = PathJob(size=(64, 36), frames=3)


@pytest.fixture
def blender(monkeypatch):
    """Programs in the place of the one that runs in Blender."""

    def stand_in(program):
        monkeypatch.setattr(blender_path, "BLENDER_PROGRAM", ("-c", program))

    return stand_in


@pytest.mark.blender
def test_every_way_is_timed_with_and_without_passes_and_its_parts_make_its_wall_time():
    pytest.importorskip("bpy")
    path = measure(SMALL)
    everything = ("depth", "mask:player_1", "mask:player_2")
    assert [(cost.way, cost.passes) for cost in path.costs] == [
        ("still", ()),
        ("range", ()),
        ("still", everything),
        ("range", everything),
    ]
    for cost in path.costs:
        assert cost.frames == 3 and tuple(cost.parts) == PARTS
        assert cost.drawing > 0
        assert min(value for name, value in cost.parts.items() if name != "pipe") > 0
        assert cost.quartiles[0] <= cost.overhead <= cost.quartiles[1]
    assert path.overhead == max(cost.overhead for cost in path.costs)
    assert path.blender.count(".") == 2


REPORT = """
import json, sys
spec = json.load(open(sys.argv[2]))
names = "evaluate request pipe conversion result save".split()
sample = dict(zip(names, (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)), drawing=10.0)
samples = [sample | {"wall": wall} for wall in (31.0, 41.0, 30.0)]
way = {"way": "still", "passes": [], "samples": samples}
json.dump({"blender": "5.0.1", "ways": [way]}, open(spec["out"], "w"))
"""


def test_overhead_is_wall_time_less_drawing_in_milliseconds_and_its_median_counts(blender):
    blender(REPORT)
    (cost,) = measure(SMALL).costs
    assert cost.overhead == pytest.approx(21e3)
    assert cost.quartiles == pytest.approx((20.5e3, 26e3))
    assert cost.drawing == pytest.approx(10e3)
    assert cost.parts == pytest.approx(dict(zip(PARTS, range(1000, 7000, 1000), strict=True)))


def test_the_section_is_plain_values_with_the_limit_beside_the_worst_overhead(blender):
    blender(REPORT)
    section = blender_path_section(SMALL)
    again = json.loads(json.dumps(section))
    assert (again["limit_ms"], again["width"], again["height"]) == (15.0, 64, 36)
    assert again["overhead_ms"] == pytest.approx(21e3) and again["model"] == "fake"
    assert again["costs"][0]["way"] == "still" and "skipped" not in again


@pytest.mark.parametrize(
    ("program", "reason"),
    [
        ("raise ModuleNotFoundError(\"No module named 'bpy'\")", "pip install"),
        ("raise SystemExit('the lens fell off')", "exit code 1.*the lens fell off"),
    ],
)
def test_where_blender_is_missing_or_fails_the_section_says_why(blender, program, reason):
    blender(program)
    with pytest.raises(BlenderPathError, match=reason):
        measure(SMALL)
    assert set(blender_path_section(SMALL)) == {"limit_ms", "width", "height", "skipped"}


def test_the_spec_says_what_the_program_in_blender_asks_for(tmp_path):
    pytest.importorskip("bpy")
    from blender_addon.examples.path_costs import CostSpec

    spec = CostSpec(**blender_path._spec(SMALL, tmp_path))
    assert spec.worker[:2] == [sys.executable, "-u"] and spec.worker[-1] == "--fake"
    assert (spec.camera["width"], spec.camera["height"]) == SMALL.size
    edges = np.array(list(spec.boxes.values()))
    assert (edges >= 0).all() and (edges <= [64, 36, 64, 36]).all()


def test_a_real_model_starts_from_its_sample_clip_and_one_without_says_what_is_missing(tmp_path):
    job = dataclasses.replace(SMALL, model="duel", size=(128, 72))
    spec = blender_path._spec(job, tmp_path)
    assert spec["image"].endswith(".png") and "--fake" not in spec["worker"]
    assert (spec["camera"]["width"], spec["camera"]["height"]) == (128, 72)
    (tmp_path / "bare.safetensors").write_bytes(b"")
    with pytest.raises(PlayableEnvironmentError, match="no sample clip"):
        measure(dataclasses.replace(job, model=str(tmp_path / "bare.safetensors")))
