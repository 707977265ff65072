"""Where shots come from and where their frames go: clips, state files, videos."""

import json

import cv2
import numpy as np
import pytest
import tiny_model

from pe_runtime.contract.errors import EpisodeError, ShotError
from pe_runtime.images import ImageError, write_png
from pe_runtime.shots.clips import shot_of_actions, start_from, start_from_clip
from pe_runtime.shots.video import write_video


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    return tiny_model.write_clip(tmp_path_factory.mktemp("clip"))


def frames(folder, count=3, width=33, height=21):
    """Pictures of one grey each, brighter with each frame."""
    paths = [folder / f"{index}.png" for index in range(count)]
    for index, path in enumerate(paths):
        write_png(path, np.full((height, width, 3), 40 * (index + 1), np.uint8))
    return paths


def test_a_data_set_and_its_first_episode_are_the_same_start(clip):
    whole, one = start_from_clip(clip), start_from_clip(clip / "00000")
    assert whole == one
    assert whole.image.endswith("frames/0/0000.png")
    assert whole.boxes["player_1"] == pytest.approx(tiny_model.boxes()["player_1"], abs=1e-4)


def test_a_later_frame_of_a_clip_is_its_own_start(clip):
    assert start_from_clip(clip, frame=2).image.endswith("frames/0/0002.png")


def test_a_folder_without_a_clip_is_refused(clip, tmp_path):
    with pytest.raises(EpisodeError, match=str(tmp_path)):
        start_from_clip(tmp_path)
    (tmp_path / "dataset.json").write_text((clip / "dataset.json").read_text())
    with pytest.raises(EpisodeError, match="no complete clip"):
        start_from_clip(tmp_path)


def test_a_state_file_starts_a_shot_with_the_camera_it_holds(tmp_path):
    path = tmp_path / "state.json"
    path.write_text(json.dumps({"objects": {}, "camera": tiny_model.camera().as_dict()}))
    start, camera = start_from(path)
    assert start.state == str(path)
    assert camera == tiny_model.camera()
    path.write_text("{}")
    with pytest.raises(ShotError, match="pe encode"):
        start_from(path)


def test_a_shot_of_actions_lasts_until_the_longest_list_of_them_ends(clip):
    start = start_from_clip(clip)
    runs = {"player_1": [(1, 2)], "player_2": [(0, 5)]}
    shot = shot_of_actions("tiny", (start, start.camera), runs, fps=12.0, steps_per_second=5.0)
    assert (shot.frame_start, shot.frame_end) == (1, 13)
    assert shot.action_at("player_1", 13) == 1


def test_a_video_has_every_frame_in_order_without_the_odd_row(tmp_path):
    write_video(frames(tmp_path), 12.0, tmp_path / "v.mp4")
    video = cv2.VideoCapture(str(tmp_path / "v.mp4"))
    pictures = [video.read()[1] for _ in range(3)]
    assert [round(float(each.mean()) / 40) for each in pictures] == [1, 2, 3]
    assert pictures[0].shape == (20, 32, 3)
    assert video.get(cv2.CAP_PROP_FPS) == 12.0


def test_a_failed_video_leaves_nothing_behind_and_names_the_frame(tmp_path):
    paths = frames(tmp_path)
    write_png(paths[1], np.zeros((8, 8, 3), np.uint8))
    for listed, named in [(paths, "1.png"), ([*paths[:1], tmp_path / "9.png"], "9.png"), ([], "v")]:
        with pytest.raises(ImageError, match=named):
            write_video(listed, 12.0, tmp_path / "v.mp4")
    with pytest.raises(ImageError, match="cannot write"):
        write_video(paths[:1], 12.0, tmp_path / "no_folder" / "v.mp4")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["0.png", "1.png", "2.png"]
