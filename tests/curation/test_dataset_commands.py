"""`pe dataset record | info | disturb | shrink` on the command line."""

import pytest
from command_line import result, run
from small_dataset import FRAMES, write_small

from pe_runtime import recording
from pe_runtime.contract.episode import read_info


@pytest.fixture
def jobs(monkeypatch):
    """Jobs that were to be recorded; a small data set is written in their place."""
    seen = []

    def pretend(job, processes, on_progress):
        seen.append(job)
        write_small(job.output, 1, job.views, job.seed)

    monkeypatch.setattr(recording, "record", pretend)
    return seen


def test_splits_are_recorded_with_seeds_that_follow_the_data_sets(capsys, jobs, tmp_path):
    splits = ("--splits", "train=3,val=1,test=2")
    facts = result(
        capsys, "dataset", "record", "--scene", "court", *splits, "-o", tmp_path, "--seed", "10"
    )
    assert [(job.output.name, job.sequences, job.seed, job.views) for job in jobs] == [
        ("train", 3, 11, 1),
        ("val", 1, 12, 2),
        ("test", 2, 13, 2),
    ]
    assert list(facts["splits"]) == ["train", "val", "test"]
    assert facts["splits"]["val"]["seed"] == 12


@pytest.mark.parametrize(
    ("options", "views"),
    [
        (("--scene", "court", "--sequences", "1"), [1]),
        (("--scene", "duel-camera", "--sequences", "1"), [2]),
        (("--scene", "duel-camera", "--splits", "train=1"), [2]),
        (("--scene", "court", "--splits", "train=1,test=1", "--views", "1"), [1, 1]),
    ],
)
def test_views_are_the_scenes_unless_asked_for(capsys, jobs, tmp_path, options, views):
    result(capsys, "dataset", "record", *options, "-o", tmp_path)
    assert [job.views for job in jobs] == views


@pytest.mark.parametrize("options", [(), ("--sequences", "1", "--splits", "train=1")])
def test_a_recording_needs_a_number_or_splits(capsys, jobs, tmp_path, options):
    code, _, err = run(capsys, "dataset", "record", "-o", tmp_path, *options)
    assert code == 1
    assert "either --sequences" in err
    assert not jobs


def test_info_is_a_table_with_a_column_for_each_split(capsys, tmp_path):
    write_small(tmp_path / "train", episodes=2)
    write_small(tmp_path / "test", episodes=1, views=2)
    code, out, err = run(capsys, "dataset", "info", tmp_path, "--sheet", tmp_path / "sheet.png")
    assert (code, err) == (0, "")
    rows = {
        line.split("│")[1].strip(): line.split("│")[2:-1]
        for line in out.splitlines()
        if line.startswith("│")
    }
    assert [cell.strip() for cell in rows["frames"]] == [str(2 * FRAMES), str(2 * FRAMES)]
    assert [cell.strip() for cell in rows["complete episodes"]] == ["2 of 2", "1 of 1"]
    assert "20 / 20 / 20 px" in out
    assert (tmp_path / "sheet.png").is_file()


def test_disturb_copies_every_split_with_the_noise_asked_for(capsys, tmp_path):
    for split in ("train", "val"):
        write_small(tmp_path / "clean" / split, episodes=1)
    noise = ("--dropout", "0.5", "--camera-degrees", "1")
    copy = tmp_path / "noisy"
    facts = result(capsys, "dataset", "disturb", tmp_path / "clean", "-o", copy, *noise)
    for told in facts["splits"].values():
        assert (told["noise"]["dropout"], told["noise"]["camera_degrees"]) == (0.5, 1.0)
    assert read_info(copy / "val") == read_info(tmp_path / "clean" / "val")


def test_disturb_on_the_command_line_has_the_modules_amounts(capsys, tmp_path):
    from dataclasses import asdict

    from pe_runtime.curation.noise import Noise

    write_small(tmp_path / "clean", episodes=1)
    facts = result(capsys, "dataset", "disturb", tmp_path / "clean", "-o", tmp_path / "noisy")
    assert facts["noise"] == asdict(Noise())


def test_shrink_copies_every_split_at_half_the_size(capsys, tmp_path):
    for split in ("train", "val"):
        write_small(tmp_path / "large" / split, episodes=1)
    large, small = read_info(tmp_path / "large" / "val"), tmp_path / "small"
    facts = result(capsys, "dataset", "shrink", tmp_path / "large", "-o", small)
    assert set(facts["splits"]) == {"train", "val"}
    assert read_info(small / "val").width == large.width // 2


def test_disturb_refuses_a_share_above_one(capsys, tmp_path):
    code, _, err = run(capsys, "dataset", "disturb", tmp_path, "-o", "x", "--dropout", "2")
    assert code == 2
    assert "dropout" in err
