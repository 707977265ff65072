"""Data sets of the release become ours: same geometry, same pixels, and a report of the rest."""

import cv2
import numpy as np
import pytest
from interop.official_folders import (
    SIZE,
    annotations,
    filmed,
    imported,
    options,
    pose,
    write_sequence,
    write_split,
)

from pe_runtime.contract.camera import project
from pe_runtime.contract.episode import read_dataset, read_episode
from pe_runtime.dataset import load_clips
from pe_runtime.images import is_rgb_png, read_image
from pe_runtime.interop.dataset_pictures import resized
from pe_runtime.interop.official_dataset import import_dataset

OURS = {"tennis": lambda p: p, "minecraft": lambda p: p[..., [0, 2, 1]] * [1, -1, 1]}


def one(tmp_path, frames=5, views=1, world="tennis", options=None, **changes):
    """Import one sequence with changed pickles."""
    write_sequence(tmp_path / "in" / "00000", world=world, frames=frames, views=views, **changes)
    split, (episode,) = imported(tmp_path / "in", tmp_path / "out", **options or {})
    return split, episode


@pytest.mark.parametrize("world", ["tennis", "minecraft"])
@pytest.mark.parametrize("size", [SIZE, (512, 288), (100, 30)])
def test_imported_cameras_see_the_players_where_their_boxes_stand(tmp_path, world, size):
    write_split(tmp_path / "in" / "train", world=world, views=2)
    report = import_dataset(tmp_path / "in", tmp_path / "out", options(size=size))
    assert (report.world, report.told_by) == (world, "cameras")
    info, (path, _) = read_dataset(tmp_path / "out" / "train")
    assert (info.width, info.height, info.views) == (*size, 2)
    episode = read_episode(path)
    feet = OURS[world](filmed(world, 5)[3])
    np.testing.assert_allclose(episode.arrays.positions, feet, atol=2e-3)
    for view in range(2):
        for frame in range(5):
            foot = OURS[world](filmed(world, 5, view)[3][frame])
            pixels, depth = project(episode.camera(view, frame), foot)
            left, _, right, bottom = episode.arrays.boxes[view, frame].T
            assert (depth > 0).all()
            np.testing.assert_allclose(pixels.T, [(left + right) / 2, bottom], atol=1e-3 * size[0])


def test_cameras_stand_upright_in_a_world_whose_up_is_z(tmp_path):
    for world in ("tennis", "minecraft"):
        _, episode = one(tmp_path / world, world=world)
        pose = episode.camera(0, 0).world_from_camera
        _, translations, _, _ = filmed(world, 5)
        np.testing.assert_allclose(pose[:3, 3], OURS[world](translations[0]), atol=1e-5)
        assert pose[2, 3] > 1  # above the ground
        assert pose[2, 1] < -0.9  # picture down is world down
        assert abs(pose[2, 0]) < 0.03  # no roll


def test_focal_lengths_are_those_of_the_written_size(tmp_path):
    _, episode = one(tmp_path / "a")
    focal = 2200 * 0.51417 * SIZE[0] / 512
    assert episode.arrays.intrinsics[0, 0, [0, 1], [0, 1]] == pytest.approx(focal, rel=1e-6)
    _, episode = one(tmp_path / "b", options={"focal_multiplier": 1.0})
    assert episode.arrays.intrinsics[0, 0, 0, 0] == pytest.approx(2200 * SIZE[0] / 512)


def test_pictures_of_the_right_size_keep_their_bytes(tmp_path):
    _, episode = one(tmp_path, views=2)
    for view in range(2):
        for frame in range(5):
            source = tmp_path / "in" / "00000" / f"{view:05d}" / f"{frame:05d}.png"
            assert episode.frame_path(view, frame).read_bytes() == source.read_bytes()


def test_transparent_pictures_stand_on_white(tmp_path):
    rgba = np.random.default_rng(0).integers(0, 256, (36, 64, 4), dtype=np.uint8)
    rgba[0, :3, 3] = (0, 255, 51)
    sequence = write_sequence(tmp_path / "in" / "00000")
    cv2.imwrite(str(sequence / "00000" / "00002.png"), rgba[..., [2, 1, 0, 3]])
    _, (episode,) = imported(tmp_path / "in", tmp_path / "out")
    found = read_image(episode.frame_path(0, 2)) * 255
    share = rgba[..., 3:].astype(float) / 255
    wanted = rgba[..., :3] * share + 255 * (1 - share)
    np.testing.assert_allclose(found, wanted, atol=0.51)
    assert (found[0, 0] == 255).all()
    assert (found[0, 1] == rgba[0, 1, :3]).all()


def test_other_formats_are_found_and_written_as_png(tmp_path):
    sequence = write_sequence(tmp_path / "in" / "00000")
    wanted = []
    for path in sorted((sequence / "00000").glob("*.png")):
        pixels = cv2.imread(str(path))
        cv2.imwrite(str(path.with_suffix(".jpg")), pixels)
        wanted.append(read_image(path.with_suffix(".jpg")))
        path.unlink()
    _, (episode,) = imported(tmp_path / "in", tmp_path / "out")
    for frame in range(5):
        assert (read_image(episode.frame_path(0, frame)) == wanted[frame]).all()


def test_pictures_of_other_depths_and_grey_ones_become_8_bit_colour(tmp_path):
    sequence = write_sequence(tmp_path / "in" / "00000") / "00000"
    deep = np.random.default_rng(0).integers(0, 65536, (36, 64, 3), dtype=np.uint16)
    cv2.imwrite(str(sequence / "00001.png"), deep)
    cv2.imwrite(str(sequence / "00002.png"), (deep[..., 0] // 256).astype(np.uint8))
    _, (episode,) = imported(tmp_path / "in", tmp_path / "out")
    for frame in (1, 2):
        assert is_rgb_png(episode.frame_path(0, frame), SIZE)
        wanted = read_image(sequence / f"{frame:05d}.png")
        np.testing.assert_allclose(
            read_image(episode.frame_path(0, frame)), wanted, atol=0.51 / 255
        )
    assert not is_rgb_png(sequence / "00001.png", SIZE)
    assert not is_rgb_png(sequence / "00000.png", (64, 35))
    assert not is_rgb_png(sequence / "focals.pkl", SIZE)


def test_resizing_averages_like_a_loop_over_pixels():
    picture = np.random.default_rng(1).random((9, 14, 3)).astype(np.float32)
    for width, height in ((7, 5), (14, 4), (20, 30), (1, 1)):
        found = resized(picture, (width, height))
        for row, column in np.ndindex(height, width):
            total, wanted = 0.0, np.zeros(3)
            for y, x in np.ndindex(9, 14):
                dy = abs(y + 0.5 - (row + 0.5) * 9 / height) / max(9 / height, 1)
                dx = abs(x + 0.5 - (column + 0.5) * 14 / width) / max(14 / width, 1)
                share = max(0, 1 - dy) * max(0, 1 - dx)
                total, wanted = total + share, wanted + share * picture[y, x]
            np.testing.assert_allclose(found[row, column], wanted / total, atol=1e-5)


def test_larger_pictures_are_written_at_the_size_asked_for(tmp_path):
    _, episode = one(tmp_path, size=(128, 72))
    source = read_image(tmp_path / "in/00000/00000/00003.png")
    found = read_image(episode.frame_path(0, 3))
    np.testing.assert_allclose(found, resized(source, SIZE), atol=0.6 / 255)


def test_invalid_and_senseless_boxes_are_absent_and_the_latter_counted(tmp_path):
    pickles = annotations()
    boxes, validity = pickles["bounding_boxes"], pickles["bounding_box_validity"]
    boxes[0][:, 0] = 0.25, 0.25, 0.75, 0.75
    validity[0][0] = False  # Minecraft's way to say it is not seen
    boxes[1][:, 0] = np.nan
    boxes[2][:, 0] = 0.5, 0.5, 0.5, 0.6
    boxes[3][:, 0] = 1.1, 0.5, 1.2, 0.6
    boxes[4][:, 1] = 0.1, np.inf, 0.2, 0.6
    split, episode = one(tmp_path, bounding_boxes=boxes, bounding_box_validity=validity)
    present = episode.arrays.present[0]
    np.testing.assert_array_equal(present[:, 0], [False, False, False, False, True])
    np.testing.assert_array_equal(present[:, 1], [True, True, True, True, False])
    assert np.isnan(episode.arrays.boxes[0][~present]).all()
    assert split.lost_boxes == 4


def test_a_box_as_large_as_no_number_of_ours_is_absent(tmp_path):
    boxes = annotations()["bounding_boxes"]
    boxes[1][2, 0] = 1e300
    split, episode = one(tmp_path, bounding_boxes=boxes)
    assert episode.arrays.present[0, :, 0].tolist() == [True, False, True, True, True]
    assert split.lost_boxes == 1


def test_an_unseen_player_is_between_the_places_before_and_after(tmp_path):
    validity = [np.array(v) for v in ([1, 0], [0, 0], [1, 0], [1, 0], [0, 0])]
    _, episode = one(tmp_path, bounding_box_validity=validity)
    positions, feet = episode.arrays.positions, filmed("tennis", 5)[3]
    np.testing.assert_allclose(positions[1, 0], (feet[0, 0] + feet[2, 0]) / 2, atol=2e-3)
    np.testing.assert_allclose(positions[4, 0], feet[3, 0], atol=2e-3)
    assert (positions[:, 1] == 0).all()


@pytest.mark.parametrize("world", ["tennis", "minecraft"])
def test_object_poses_tell_positions(tmp_path, world):
    places = filmed(world, 5)[3] + 0.25
    places[2, 1] = np.nan
    poses = [[pose((0, 0, 0), p) for p in row] for row in places]
    split, episode = one(tmp_path, world=world, object_poses=poses)
    known = np.isfinite(places).all(-1)
    wanted = OURS[world](places)[known]
    np.testing.assert_allclose(episode.arrays.positions[known], wanted, atol=1e-5)
    between = OURS[world]((places[1, 1] + places[3, 1]) / 2)
    np.testing.assert_allclose(episode.arrays.positions[2, 1], between, atol=1e-5)
    assert split.positions == "object_poses.pkl"
    options = {"skip": 2}
    _, episode = one(tmp_path / "skip", world=world, object_poses=poses, options=options)
    np.testing.assert_allclose(episode.arrays.positions, OURS[world](places)[::3], atol=1e-5)


def test_poses_of_other_objects_than_the_boxes_are_left_aside(tmp_path):
    split, _ = one(tmp_path, object_poses=[[pose((0, 0, 0), (1, 1, 1))] * 4] * 5)
    assert split.positions == "boxes"
    assert split.notes == {"object_poses.pkl has 4 objects for 2 players": 1}


def test_an_action_leads_from_its_frame_to_the_next_for_every_player(tmp_path):
    for name, actions in (("all", [3, 0, 6, 2, 5]), ("short", [3, 0, 6, 2])):
        split, episode = one(tmp_path / name, actions=actions)
        np.testing.assert_array_equal(episode.arrays.actions, np.array([[3, 0, 6, 2]] * 2).T)
        assert split.actions == "known"
    _, episode = one(tmp_path / "odd", actions=[1, -7, 500, 2, 0])
    assert episode.arrays.actions[:, 0].tolist() == [1, -1, -1, 2]


@pytest.mark.parametrize("actions", [None, [0] * 5])
def test_actions_that_say_nothing_are_unknown(tmp_path, actions):
    split, episode = one(tmp_path, actions=actions)
    assert (episode.arrays.actions == -1).all()
    assert split.actions == "unknown"
    assert read_dataset(tmp_path / "out")[0].actions == ()


def test_other_annotations_are_kept_for_people_to_read(tmp_path):
    tree = ["x"]
    for _ in range(40):
        tree = [tree, tree]
    metadata = [{"p": pose((1, 2, 3), (4, 5, 6)), "n": np.nan, 3: (np.int64(4), {"s"})}] * 5
    _, episode = one(tmp_path, metadata=metadata, rewards=[tree] * 5)
    kept = episode.metadata
    assert kept["metadata"][4]["p"] == {"rotation": [1, 2, 3], "translation": [4, 5, 6]}
    assert (kept["metadata"][4]["n"], kept["metadata"][4]["3"]) == (None, [4, ["s"]])
    assert kept["rewards"] == "left out: too large"
    assert kept["dones"] == [False] * 4 + [True]
    assert (kept["sequence"], kept["first_frame"]) == ("00000", 0)


def test_what_is_missing_or_not_imported_is_reported(tmp_path):
    sequence = write_sequence(
        tmp_path / "in" / "00000", bounding_box_validity=None, rewards=None, keypoints=[0] * 5
    )
    (sequence / "00000" / "flow" / "2").mkdir(parents=True)
    (sequence / "00000" / "00007.txt").write_text("a note")
    split, (episode,) = imported(tmp_path / "in", tmp_path / "out")
    assert split.defaulted == {"bounding_box_validity": 1, "rewards": 1}
    assert split.unread == {"flow": 1, "keypoints.pkl": 1, "*.txt": 1}
    assert episode.arrays.present.all()


def test_each_split_becomes_a_data_set(tmp_path):
    for number, name in enumerate(("train", "val", "test")):
        write_split(tmp_path / "in" / name, count=number + 1)
    report = import_dataset(tmp_path / "in", tmp_path / "out", options())
    assert [(each.split, each.episodes) for each in report.splits] == [
        ("train", 1), ("val", 2), ("test", 3),
    ]  # fmt: skip
    assert len(load_clips(tmp_path / "out" / "test")) == 3
    import_dataset(tmp_path / "in", tmp_path / "some", options(splits=("val", "test")))
    assert {path.name for path in (tmp_path / "some").iterdir()} == {"test", "val"}
    split, _ = imported(tmp_path / "in" / "val", tmp_path / "alone")
    assert (split.split, split.episodes) == ("", 2)


def test_skipped_frames_lower_the_rate(tmp_path):
    for world, rate in (("tennis", 5.0), ("minecraft", 25.0)):
        _, episode = one(tmp_path / world, frames=8, world=world, options={"skip": 2})
        assert episode.info.steps_per_second == pytest.approx(rate / 3)
        pickles = annotations(world, 8)
        assert episode.arrays.actions[:, 0].tolist() == [pickles["actions"][t] for t in (0, 3)]
        boxes = np.stack([pickles["bounding_boxes"][t].T for t in (0, 3, 6)])
        np.testing.assert_allclose(episode.arrays.boxes[0], boxes * (*SIZE, *SIZE), rtol=1e-5)
        source = tmp_path / world / "in/00000/00000/00003.png"
        assert episode.frame_path(0, 1).read_bytes() == source.read_bytes()
        assert [each["time"] for each in episode.metadata["metadata"]] == [0, 3 / 5, 6 / 5]
    _, episode = one(tmp_path / "rate", options={"steps_per_second": 12.5})
    assert episode.info.steps_per_second == 12.5


@pytest.mark.parametrize(
    ("lengths", "wanted", "made", "left", "short"),
    [
        ((5, 5), None, [5, 5], 0, 0),
        ((20, 20), None, [20, 20], 0, 0),
        ((40, 33, 7), None, [16] * 4, 9, 1),
        ((5, 8, 1), None, [5, 5], 3, 1),
        ((9, 9), 4, [4] * 4, 2, 0),
    ],
)
def test_sequences_are_cut_into_episodes_of_one_length(
    tmp_path, lengths, wanted, made, left, short
):
    for number, frames in enumerate(lengths):
        write_sequence(tmp_path / "in" / f"{number:05d}", frames=frames)
    split, episodes = imported(tmp_path / "in", tmp_path / "out", frames=wanted)
    assert [each.arrays.frames for each in episodes] == made
    assert (split.left_out_frames, len(split.skipped)) == (left, short)
    assert not any(each.damaged for each in split.skipped)
    assert len(load_clips(tmp_path / "out")) == len(made)
    last = episodes[-1].metadata
    source = tmp_path / "in" / last["sequence"] / "00000" / f"{last['first_frame']:05d}.png"
    assert episodes[-1].frame_path(0, 0).read_bytes() == source.read_bytes()
