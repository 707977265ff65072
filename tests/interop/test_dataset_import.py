"""Imports that meet damage, contradictions and interruptions."""

import os
import shutil

import numpy as np
import pytest
from interop.official_folders import (
    Spy,
    dumps,
    files_below,
    imported,
    options,
    pose,
    rotation,
    write_sequence,
    write_split,
)

from pe_runtime.contract.episode import read_dataset
from pe_runtime.contract.errors import EpisodeError
from pe_runtime.interop.dataset_worlds import choose_world, world_seen
from pe_runtime.interop.official_dataset import import_dataset


def remove_frame(sequence):
    (sequence / "00000" / "00002.png").unlink()


def write(name, content):
    return lambda sequence: (sequence / "00000" / f"{name}.pkl").write_bytes(content)


def shorten(name):
    def cut(sequence):
        file = sequence / "00000" / f"{name}.pkl"
        file.write_bytes(file.read_bytes()[:-20])

    return cut


def unequal_cameras(sequence):
    shutil.copytree(sequence / "00000", sequence / "00001")
    (sequence / "00001" / "00004.png").unlink()


BREAKAGES = {
    "a frame missing in the middle": (remove_frame, "frame 00002.png is missing in the middle"),
    "no first frame": (lambda s: (s / "00000/00000.png").unlink(), "picture 00000 is missing"),
    "no cameras": (lambda s: (s / "00000/cameras.pkl").unlink(), "cameras.pkl is missing"),
    "a truncated pickle": (shorten("focals"), "focals.pkl is damaged"),
    "a pickle that calls": (
        write("actions", dumps(Spy(os.system, "touch touched"))), r"asks for \w+\.system",
    ),
    "too few entries": (write("focals", dumps([9.0] * 4)), "4 entries for 5 pictures"),
    "no list": (write("cameras", dumps(7)), "holds int; expected a list"),
    "no poses": (write("cameras", dumps([1.0] * 5)), "expected a pose, found float"),
    "a pose that is not finite": (
        write("cameras", dumps([pose((0, 0, 0), (0, np.nan, 1))] * 5)), "NaN or infinity",
    ),
    "a focal length of 0": (write("focals", dumps([0.0] * 5)), "no number of pixels above 0"),
    "boxes the other way round": (
        write("bounding_boxes", dumps([np.zeros((2, 4))] * 5)), r"shape \(4, players\)",
    ),
    "boxes in pixels": (
        write("bounding_boxes", dumps([np.array([[9.0] * 2, [5] * 2, [20] * 2, [30] * 2])] * 5)),
        "expected shares of the picture",
    ),
    "boxes that change their number": (
        write("bounding_boxes", dumps([np.zeros((4, 1 + t % 2)) for t in range(5)])), "its shape",
    ),
    "validity of other players": (
        write("bounding_box_validity", dumps([np.ones(3)] * 5)), "tells of 3 players",
    ),
    "actions that are none": (write("actions", dumps([0.5] * 5)), "not whole numbers"),
    "an empty sequence": (lambda s: shutil.rmtree(s / "00000"), "no camera's folder"),
    "cameras of other lengths": (unequal_cameras, "different numbers of pictures"),
}  # fmt: skip


@pytest.mark.parametrize("case", BREAKAGES)
def test_a_broken_sequence_is_left_out_with_its_reason(tmp_path, monkeypatch, case):
    monkeypatch.chdir(tmp_path)
    write_split(tmp_path / "in", count=3)
    damage, reason = BREAKAGES[case]
    damage(tmp_path / "in" / "00001")
    with pytest.raises(EpisodeError, match=f"00001: .*{reason}"):
        imported(tmp_path / "in", tmp_path / "strict", strict=True)
    assert not (tmp_path / "strict").exists()
    split, episodes = imported(tmp_path / "in", tmp_path / "out")
    assert [each.metadata["sequence"] for each in episodes] == ["00000", "00002"]
    (skipped,) = split.skipped
    assert (skipped.sequence, skipped.damaged) == ("00001", True)
    assert not (tmp_path / "touched").exists()
    for name in ("00000", "00002"):
        shutil.rmtree(tmp_path / "in" / name)
    with pytest.raises(EpisodeError, match=f"in has no .* \\(1 found\\); 00001: .*{reason}"):
        imported(tmp_path / "in", tmp_path / "nothing" / "at" / "all")
    assert not (tmp_path / "nothing").exists()


def test_sequences_of_other_players_or_cameras_than_most_are_left_out(tmp_path):
    write_split(tmp_path / "in", count=3)
    threes = {"bounding_boxes": [np.zeros((4, 3))] * 5, "bounding_box_validity": [np.ones(3)] * 5}
    write_sequence(tmp_path / "in" / "0", **threes)
    write_sequence(tmp_path / "in" / "two", views=2)
    split, _ = imported(tmp_path / "in", tmp_path / "out")
    reasons = {each.sequence: each.reason for each in split.skipped}
    assert set(reasons) == {"0", "two"}
    assert "1 camera(s) and 3 player(s), most have 1 camera(s) and 2" in reasons["0"]
    assert "2 camera(s) and 2 player(s)" in reasons["two"]
    assert (split.sequences, split.imported) == (5, 3)


def test_what_is_only_kept_to_be_read_costs_no_sequence_but_is_no_less_an_error(tmp_path):
    write_split(tmp_path / "in", count=2)
    write("rewards", dumps(Spy(os.system, "touch touched")))(tmp_path / "in" / "00000")
    shorten("metadata")(tmp_path / "in" / "00001")
    split, episodes = imported(tmp_path / "in", tmp_path / "out")
    assert (split.sequences, split.imported, split.episodes) == (2, 2, 2)
    assert ["rewards" in each.metadata for each in episodes] == [False, True]
    assert ["metadata" in each.metadata for each in episodes] == [True, False]
    first, second = split.skipped
    assert "rewards.pkl asks for" in first.reason
    assert "metadata.pkl is damaged" in second.reason
    assert first.damaged and second.damaged
    with pytest.raises(EpisodeError, match="00000: imported without an annotation"):
        imported(tmp_path / "in", tmp_path / "strict", strict=True)
    assert not (tmp_path / "strict").exists()


def test_a_folder_that_is_no_data_set_is_one_clear_error(tmp_path):
    (tmp_path / "file").write_text("")
    (tmp_path / "empty" / ".hidden").mkdir(parents=True)
    (tmp_path / "hollow" / "train").mkdir(parents=True)
    sequence = write_sequence(tmp_path / "in" / "00000")
    for root, message in [
        ("none", "none is no folder"),
        ("file", "file is no folder"),
        ("empty", "empty holds no sequences; expected folders such as"),
        ("hollow", "train holds no sequences"),
        (sequence, "give the folder above it"),
    ]:
        with pytest.raises(EpisodeError, match=message):
            import_dataset(tmp_path / root, tmp_path / "out", options())
    for splits, message in [(("train",), "no split train; it has none"), (("dev",), "'dev' is un")]:
        with pytest.raises(EpisodeError, match=message):
            import_dataset(tmp_path / "in", tmp_path / "out", options(splits=splits))
    assert not (tmp_path / "out").exists()


def test_an_import_into_its_source_is_refused(tmp_path):
    root = write_split(tmp_path / "in")
    before = files_below(root)
    for output in (root, root / "ours", tmp_path / "x" / ".." / "in"):
        with pytest.raises(EpisodeError, match="write elsewhere"):
            import_dataset(root, output, options())
    assert files_below(root) == before


@pytest.mark.parametrize(
    "changes",
    [{"skip": -1}, {"frames": 1}, {"focal_multiplier": 0.0}, {"steps_per_second": np.nan}],
)
def test_options_out_of_range_are_refused_by_name(changes):
    with pytest.raises(EpisodeError, match=f"{next(iter(changes))} is"):
        options(**changes)


@pytest.mark.parametrize("azimuth", np.linspace(-3, 3, 13))
@pytest.mark.parametrize("pitch", [0.0, 0.3, 0.8, 1.2])
def test_the_world_is_told_from_cameras_all_around_it(azimuth, pitch):
    """Cameras that look at the origin from above, in either world."""
    in_y_up = rotation(-pitch, azimuth, 0.0)
    distance = in_y_up @ [0, 0, 8.0] + [0, 1.0, 0]
    angles = np.array([[-pitch, azimuth, 0.0]])
    assert world_seen(angles, distance[None]) == "minecraft"
    turned = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]) @ in_y_up
    a = -np.arcsin(turned[1, 2])
    b, c = np.arctan2(turned[0, 2], turned[2, 2]), np.arctan2(turned[1, 0], turned[1, 1])
    np.testing.assert_allclose(rotation(a, b, c), turned, atol=1e-9)
    place = distance[[0, 2, 1]] * [1, -1, 1]
    assert world_seen(np.array([[a, b, c]]), place[None]) == "tennis"


def test_cameras_that_contradict_each_other_or_the_user_are_an_error(tmp_path):
    write_split(tmp_path / "in" / "train", count=2)
    write_split(tmp_path / "in" / "val", count=2, world="minecraft")
    root = tmp_path / "in"
    with pytest.raises(EpisodeError, match=r"contradict each other: .*val/0000\d are minecraft's"):
        import_dataset(root, tmp_path / "out", options())
    with pytest.raises(EpisodeError, match="val has no .* cameras are minecraft's, the data set"):
        import_dataset(root, tmp_path / "out", options(world="tennis"))
    with pytest.raises(EpisodeError, match="no data set of minecraft: .* z up, as in tennis"):
        import_dataset(root / "train", tmp_path / "out", options(world="minecraft"))
    with pytest.raises(EpisodeError, match="'golf' is unknown; expected tennis or minecraft"):
        import_dataset(root, tmp_path / "out", options(world="golf"))
    assert not (tmp_path / "out").exists()
    shutil.move(root / "val" / "00000", root / "train" / "stray")
    split, episodes = imported(root / "train", tmp_path / "out", world="tennis")
    assert (len(episodes), [each.sequence for each in split.skipped]) == (2, ["stray"])


def test_cameras_that_tell_nothing_need_the_user_to():
    lying = np.array([[0.0, 0.0, np.pi / 2]])
    assert world_seen(lying, np.array([[1.0, 1.0, 1.0]])) is None
    with pytest.raises(EpisodeError, match="give --world"):
        choose_world({"00000": None}, None)
    world, told_by = choose_world({"00000": None}, "minecraft")
    assert (world.up, told_by) == ("y", "--world")


class Killed(BaseException):
    """What a signal would do."""


def test_a_killed_import_leaves_whole_episodes_and_goes_on_to_the_same_bytes(tmp_path):
    write_split(tmp_path / "in" / "train", count=3, frames=6, views=2)
    import_dataset(tmp_path / "in", tmp_path / "whole", options(frames=2))
    for rounds in range(1, 4):

        def kill(done, total, last=rounds):
            assert total == 9
            if done == last:
                raise Killed

        with pytest.raises(Killed):
            import_dataset(tmp_path / "in", tmp_path / "out", options(frames=2), kill)
        info, episodes = read_dataset(tmp_path / "out" / "train")
        assert len(episodes) == rounds
        assert info.count == 9
        assert sorted(p.name for p in (tmp_path / "out" / "train").iterdir()) == [
            *(path.name for path in episodes), "dataset.json",
        ]  # fmt: skip
    (tmp_path / "out" / "train" / ".importing" / "frames" / "0").mkdir(parents=True)
    report = import_dataset(tmp_path / "in", tmp_path / "out", options(frames=2))
    assert (report.splits[0].kept, report.splits[0].episodes) == (3, 9)
    assert files_below(tmp_path / "out") == files_below(tmp_path / "whole")


def test_another_import_in_the_folder_is_refused_and_left_as_it_is(tmp_path):
    write_split(tmp_path / "in", frames=4)
    import_dataset(tmp_path / "in", tmp_path / "out", options())
    before = files_below(tmp_path / "out")
    write_split(tmp_path / "other", frames=4, world="minecraft")
    for root, changes, message in [
        ("in", {"size": (32, 18)}, "holds another data set"),
        ("in", {"frames": 2}, "is from another import"),
        ("in", {"focal_multiplier": 0.6}, "its intrinsics, positions differ"),
        ("other", {}, "holds another data set"),
    ]:
        with pytest.raises(EpisodeError, match=message):
            import_dataset(tmp_path / root, tmp_path / "out", options(**changes))
        assert files_below(tmp_path / "out") == before


def test_a_repaired_sequence_is_added_by_importing_again(tmp_path):
    write_split(tmp_path / "in", count=3)
    picture = tmp_path / "in" / "00001" / "00000" / "00002.png"
    kept = picture.read_bytes()
    picture.unlink()
    split, _ = imported(tmp_path / "in", tmp_path / "out")
    assert (split.episodes, read_dataset(tmp_path / "out")[0].count) == (2, 2)
    picture.write_bytes(kept)
    split, episodes = imported(tmp_path / "in", tmp_path / "out")
    assert (split.episodes, split.kept, split.skipped) == (3, 2, ())
    assert [each.metadata["sequence"] for each in episodes] == ["00000", "00002", "00001"]
    assert read_dataset(tmp_path / "out")[0].count == 3


@pytest.mark.parametrize("damage", [lambda c: c[:100], lambda c: c[:3000], lambda c: b"GIF89a"])
def test_a_damaged_picture_leaves_out_its_episode_only(tmp_path, damage):
    write_split(tmp_path / "in", frames=6)
    picture = tmp_path / "in" / "00001" / "00000" / "00003.png"
    picture.write_bytes(damage(picture.read_bytes()))
    split, episodes = imported(tmp_path / "in", tmp_path / "out", frames=2)
    told = [(each.metadata["sequence"], each.metadata["first_frame"]) for each in episodes]
    assert told == [("00000", 0), ("00000", 2), ("00000", 4), ("00001", 0), ("00001", 4)]
    (skipped,) = split.skipped
    assert skipped.reason.startswith("frames from 00002 on: ")
    assert "00003.png" in skipped.reason
    assert read_dataset(tmp_path / "out")[0].count == 5
    with pytest.raises(EpisodeError, match=r"in/00001: frames from 00002 on: .*00003\.png"):
        imported(tmp_path / "in", tmp_path / "strict", frames=2, strict=True)
    shutil.rmtree(tmp_path / "in" / "00000")
    with pytest.raises(EpisodeError, match="no episode of .* could be written; 00001"):
        imported(tmp_path / "in", tmp_path / "none" / "data")
    assert not (tmp_path / "none").exists()


def test_a_disk_that_refuses_to_write_is_an_error_and_no_skipped_sequence(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    write_split(tmp_path / "in")
    monkeypatch.setattr(shutil, "copyfile", full)
    with pytest.raises(OSError, match="No space left"):
        imported(tmp_path / "in", tmp_path / "out")
    assert not (tmp_path / "out").exists()
