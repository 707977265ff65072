"""`pe play` as its user meets it: scripts, lines on stdin, and what is refused."""

import io
import json
import os
import signal

import cv2
import numpy as np
import pytest
import tiny_model
from command_line import result, run

from pe_runtime.environment import PlayableEnvironment
from pe_runtime.images import read_image
from pe_runtime.shots import load_shot


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A model with its sample clip beside it, and the files of a picture."""
    folder = tmp_path_factory.mktemp("made")
    tiny_model.write_clip(folder / "tiny_clip")
    tiny_model.write_model(folder / "tiny.safetensors")
    (folder / "camera.json").write_text(json.dumps(tiny_model.camera().as_dict()))
    (folder / "boxes.json").write_text(json.dumps(tiny_model.boxes()))
    return folder


def play(made, *arguments):
    return "play", "--model", made / "tiny.safetensors", *arguments


def typed(monkeypatch, text):
    monkeypatch.setattr("sys.stdin", io.StringIO(text))


def test_a_script_writes_frames_paths_a_shot_and_a_video(capsys, made, tmp_path):
    options = play(made, "--out", tmp_path, "--fps", "10", "--mp4", "--actions", "2*2,3;1*3")
    found = result(capsys, *options)
    assert found["written"] == found["frames"] == [1, 2, 3, 4, 5, 6, 7]
    assert len(found["paths"]["player_1"]) == 7
    assert read_image(tmp_path / "0007.png").shape == (16, 32, 3)
    video = cv2.VideoCapture(found["video"])
    assert video.get(cv2.CAP_PROP_FRAME_COUNT) == 7
    named = play(made, *options[3:-1], "player_1=left*2,right;player_2=idle*3")
    assert result(capsys, *named)["kept"] == found["written"]


def test_picture_clip_and_state_file_are_the_same_start(capsys, made, tmp_path):
    picture = made / "tiny_clip/00000/frames/0/0000.png"
    seen = ("--camera", made / "camera.json", "--boxes", made / "boxes.json")
    state = tmp_path / "state.json"
    run(capsys, "encode", picture, *seen, "-o", state, "--model", made / "tiny.safetensors")
    starts = {
        "default": (),
        "clip": ("--start", made / "tiny_clip"),
        "state": ("--start", state),
        "picture": ("--image", picture, *seen),
    }
    for name, start in starts.items():
        result(capsys, *play(made, *start, "--actions", "2", "-o", tmp_path / name))
    frames = {(tmp_path / name / "0002.png").read_bytes() for name in starts}
    assert len(frames) == 1


def test_a_player_without_actions_stands_where_it_stood(capsys, made, tmp_path):
    found = result(capsys, *play(made, "--actions", ";2*3", "-o", tmp_path))
    first, *later = found["paths"]["player_1"]
    assert all(each == first for each in later)
    assert found["paths"]["player_2"][0] != found["paths"]["player_2"][-1]


def test_camera_style_size_and_quality_of_a_script_end_in_its_shot(capsys, made, tmp_path):
    wishes = ("--orbit", "-20", "--raise", "1", "--dolly", "0.5", "--size", "20x16")
    styles = ("--quality", "draft", "--style", "player_1=player_2:0.7")
    result(capsys, *play(made, *wishes, *styles, "--actions", "2*2", "-o", tmp_path / "a"))
    shot = load_shot(tmp_path / "a" / "shot.json")
    assert (shot.quality, shot.cameras[0].width, shot.cameras[0].height) == ("draft", 20, 16)
    assert shot.track("player_1").styles[0].weight == 0.7
    first, _, last = (each.world_from_camera[:3, 3] for each in shot.cameras)
    assert last[0] < first[0]
    assert last[2] > first[2]
    assert result(capsys, "render", tmp_path / "a" / "shot.json", "-o", tmp_path / "b")
    for name in ("0001.png", "0002.png", "0003.png"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
    assert read_image(tmp_path / "b" / "0002.png").shape == (16, 20, 3)


def test_the_shot_of_a_script_renders_elsewhere_to_the_same_bytes(
    capsys, made, tmp_path, monkeypatch
):
    monkeypatch.chdir(made)
    begun = ("play", "--model", "tiny.safetensors", "--start", "tiny_clip", "-o", tmp_path / "a")
    result(capsys, *begun, "--actions", "left*3")
    monkeypatch.chdir(tmp_path)
    code, out, _ = run(capsys, "render", "a/shot.json", "-o", "b", "--frames", "2-3")
    assert (code, "2 frames drawn" in out) == (0, True)
    assert sorted(path.name for path in (tmp_path / "b").iterdir()) == ["0002.png", "0003.png"]
    for name in ("0002.png", "0003.png"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_lines_on_stdin_play_take_by_take_and_render_repeats_them(
    capsys, made, tmp_path, monkeypatch
):
    typed(monkeypatch, "2 left*2\n d w +\nb\nagain\ntab 3\nu\nm\nn\n1\n q\n 2 2 2\n")
    code, out, err = run(capsys, *play(made, "-o", tmp_path, "--json"))
    assert code == 0, err
    first, second = json.loads(out)["takes"]
    assert (first["frames"], second["frames"]) == ([1, 2, 3, 4, 5], [1, 2])
    assert first["video"].endswith("take_1/play.mp4")
    assert second["video"] is None
    assert "step 4: player_1 left, player_2 idle · player_1 as player_2 · camera +5°" in err
    for take in (first, second):
        kept = result(capsys, "render", take["shot"], "-o", take["folder"])["kept"]
        assert kept == take["frames"]
        result(capsys, "render", take["shot"], "-o", tmp_path / "again")
        for frame in take["frames"]:
            again = read_image(tmp_path / "again" / f"{frame:04d}.png")
            np.testing.assert_array_equal(again, read_image(f"{take['folder']}/{frame:04d}.png"))


def test_the_end_of_stdin_is_an_end_like_any_other(capsys, made, tmp_path, monkeypatch):
    typed(monkeypatch, "2\n")
    code, out, _ = run(capsys, *play(made, "-o", tmp_path, "--mp4"))
    assert code == 0
    assert "take_1: frames 1-2; again with: pe render" in out
    assert (tmp_path / "take_1" / "play.mp4").is_file()


def test_a_written_command_without_a_meaning_ends_with_its_name_and_keeps_the_take(
    capsys, made, tmp_path, monkeypatch
):
    typed(monkeypatch, "2\njump\n3\n")
    code, out, err = run(capsys, *play(made, "-o", tmp_path))
    assert (code, out) == (1, "")
    assert "'jump'" in err.splitlines()[-1]
    assert load_shot(tmp_path / "take_1" / "shot.json").frame_end == 2


def test_a_wished_style_is_worn_live_too(capsys, made, tmp_path, monkeypatch):
    typed(monkeypatch, "2\n")
    run(capsys, *play(made, "-o", tmp_path, "--style", "player_2=player_1:0.5", "--fps", "10"))
    shot = load_shot(tmp_path / "take_1" / "shot.json")
    assert (shot.frame_end, shot.track("player_2").styles[0].weight) == (3, 0.5)


@pytest.mark.parametrize(
    ("options", "named"),
    [
        (("--actions", "player_1=lift"), "did you mean 'left'"),
        (("--actions", "player_9=left"), "did you mean 'player_"),
        (("--actions", "4"), "1 idle, 2 left, 3 right"),
        (("--actions", "1;1;1"), "this model has 2"),
        (("--actions", ""), "expected"),
        (("--actions", "2", "--fps", "0"), "above 0"),
        (("--actions", "2", "--quality", "best"), "exact, balanced, draft"),
        (("--actions", "2", "--style", "player_1=ground"), "no player 'ground'"),
        (("--image", "a.png"), "--camera, --boxes missing"),
        (("--camera", "c.json", "--boxes", "b.json"), "--image missing"),
        (("--orbit", "20"), "--actions"),
        (("--fps", "12"), "--fps 5, 10"),
    ],
    ids=str,
)
def test_what_cannot_be_played_is_refused_before_anything_is_written(
    capsys, made, tmp_path, options, named
):
    code, out, err = run(capsys, *play(made, *options, "--out", tmp_path / "x"))
    assert (code, out) == (1, "")
    assert named in err
    assert not (tmp_path / "x").exists()


def test_a_start_is_one_thing_only(capsys, made, tmp_path):
    picture = ("--image", "a.png", "--camera", "c.json", "--boxes", "b.json")
    code, _, err = run(capsys, *play(made, "--start", made / "tiny_clip", *picture))
    assert (code, "not both" in err) == (1, True)


def test_a_start_that_is_neither_clip_nor_state_is_refused(capsys, made, tmp_path):
    (tmp_path / "s.json").write_text("{}")
    for start in (tmp_path / "s.json", tmp_path / "nothing", tmp_path):
        options = play(made, "--start", start, "--out", tmp_path / "x", "--actions", "left")
        code, _, err = run(capsys, *options)
        assert code == 1
        assert str(start) in err


def test_a_model_without_a_sample_clip_asks_where_to_start(capsys, tmp_path):
    model = tiny_model.write_model(tmp_path / "alone.safetensors")
    code, _, err = run(capsys, "play", "--model", model, "--actions", "1")
    assert code == 1
    assert "say where to start" in err
    assert "alone_clip" in err


def test_ctrl_c_ends_a_script_after_the_frame_at_hand_and_lists_what_is_there(
    capsys, made, tmp_path, monkeypatch
):
    drawn, render = [], PlayableEnvironment.render

    def interrupted(*arguments):
        drawn.append(1)
        if len(drawn) == 2:
            os.kill(os.getpid(), signal.SIGINT)
        return render(*arguments)

    monkeypatch.setattr(PlayableEnvironment, "render", interrupted)
    options = play(made, "--actions", "2*4", "-o", tmp_path, "--mp4")
    code, out, _ = run(capsys, *options, "--json")
    found = json.loads(out)
    assert (code, found["stopped"], found["frames"]) == (130, True, [1, 2])
    assert not (tmp_path / "play.mp4").exists()
    monkeypatch.undo()
    assert result(capsys, *options)["kept"] == [1, 2]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_ctrl_c_while_playing_keeps_the_frames_that_were_drawn(capsys, made, tmp_path, monkeypatch):
    class Interrupted(io.StringIO):
        def __next__(self):
            if self.tell():
                raise KeyboardInterrupt
            return super().__next__()

    monkeypatch.setattr("sys.stdin", Interrupted("2 2\n1\n"))
    code, out, _ = run(capsys, *play(made, "-o", tmp_path, "--fps", "10", "--json"))
    found = json.loads(out)
    assert (code, found["stopped"]) == (130, True)
    assert found["takes"][0]["frames"] == [1, 3, 5]
