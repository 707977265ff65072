"""A session without a terminal: what each command makes of it, and the shot that repeats it."""

import json

import numpy as np
import pytest
import small_world
import torch

from pe_runtime.contract.errors import ShotError
from pe_runtime.contract.shot import Shot, Start, StyleMix
from pe_runtime.images import read_image
from pe_runtime.play import (
    CameraMove,
    LivePlay,
    Wishes,
    begin,
    finished_frames,
    learnt_actions,
    moved_camera,
    obey,
    set_stage,
    shot_of_script,
    shot_of_session,
)
from pe_runtime.play.commands import Command
from pe_runtime.play.learnt_actions import LearntAction
from pe_runtime.shots import frame_path, load_shot, prepare_shot, render_shot
from pe_runtime.state import hide, state_as_dict

IDLE, LEFT, RIGHT = range(3)
PLACES = [(-0.9, 0.0, 0.0), (0.9, 0.2, 0.0)]


def act(index):
    return Command("act", index)


ORBIT, RAISE, NEARER = Command("orbit", 1), Command("rise", 1), Command("dolly", 1)
TAB, UNDO, AGAIN, NEW = (Command(verb) for verb in ("player", "undo", "again", "new"))
BORROW, OWN, BACK = (Command(verb) for verb in ("borrow", "own", "recentre"))


@pytest.fixture(scope="module")
def world():
    return small_world.small_environment()


@pytest.fixture(scope="module")
def start(world, tmp_path_factory):
    """A state file with its camera."""
    return write_state(world, tmp_path_factory.mktemp("start") / "state.json")


def write_state(world, path, hidden=(), places=PLACES):
    view = small_world.camera()
    names = world.playable_names
    boxes = {n: small_world.box_of(p, view) for n, p in zip(names, places, strict=False)}
    shades = [(0.9, 0.1, 0.1), (0.1, 0.8, 0.2)][: len(names)]
    picture = small_world.picture_of(places[: len(names)], view, shades)
    state = world.encode(picture, view, boxes)
    for name in hidden:
        state = hide(state, name)
    path.write_text(json.dumps(state_as_dict(state)))
    return Start(state=str(path)), view


def stage_of(world, start, **wishes):
    return set_stage(world, "small", start, learnt_actions(world), Wishes(**wishes))


def played(world, start, *commands, **wishes):
    session = begin(stage_of(world, start, **wishes))
    for command in commands:
        session = obey(world, session, command)
    return session


def positions(moment):
    return {n: moment.state[n].position.tolist() for n in ("player_1", "player_2")}


def test_a_digit_is_a_step_of_the_played_one_while_the_others_rest(world, start):
    session = played(world, start, act(LEFT), TAB, act(RIGHT))
    told = [dict(moment.told) for moment in session.moments]
    assert told == [
        {},
        {"player_1": LEFT, "player_2": IDLE},
        {"player_1": IDLE, "player_2": RIGHT},
    ]
    assert session.player == "player_2"


def test_all_in_turn_one_step_is_taken_when_everyone_was_told(world, start):
    session = played(world, start, TAB, TAB, act(LEFT))
    assert (session.in_turn, session.steps, session.player) == (True, 0, "player_2")
    session = obey(world, session, act(RIGHT))
    assert session.now.told == {"player_1": LEFT, "player_2": RIGHT}
    assert (session.steps, session.player) == (1, "player_1")
    assert obey(world, session, TAB).in_turn is False


def test_states_and_memory_are_passed_on_as_the_model_itself_would(world, start):
    session = played(world, start, act(LEFT), ORBIT, act(RIGHT), AGAIN)
    state, memory = session.stage.state, None
    turned = moved_camera(session.stage.camera, session.stage.pivot, CameraMove(orbit=5.0))
    for action, camera in ((LEFT, session.stage.camera), (RIGHT, turned), (RIGHT, turned)):
        told = {"player_1": action, "player_2": IDLE}
        state, memory = world.step(state, told, camera, memory)
    for name in world.playable_names:
        assert torch.equal(session.now.state[name].position, state[name].position)
        assert torch.equal(session.now.state[name].pose, state[name].pose)


def test_a_command_leaves_the_session_before_as_it_was(world, start):
    session = played(world, start, act(LEFT))
    before = session.moments
    for command in (act(RIGHT), ORBIT, RAISE, NEARER, BORROW, TAB, UNDO, NEW):
        obey(world, session, command)
    assert session.moments is before
    assert session.now.move == CameraMove()


def test_camera_commands_add_up_and_one_brings_it_back(world, start):
    session = played(world, start, ORBIT, ORBIT, RAISE, NEARER, Command("orbit", -1))
    assert session.now.move == CameraMove(5.0, 0.25, 0.5)
    assert obey(world, session, BACK).now.move == CameraMove()


def test_the_camera_of_a_moment_stays_for_the_moments_after_it(world, start):
    session = played(world, start, act(LEFT), ORBIT, act(LEFT))
    assert [moment.move.orbit for moment in session.moments] == [0.0, 5.0, 5.0]


def test_a_style_is_borrowed_from_the_next_one_then_given_back(world, start):
    session = played(world, start, BORROW)
    assert session.now.styles["player_1"].object == "player_2"
    assert obey(world, session, BORROW).now.styles == {}
    assert obey(world, session, OWN).now.styles == {}


def test_undo_takes_back_steps_cameras_styles_and_half_told_turns(world, start):
    session = played(world, start, act(LEFT), ORBIT, BORROW, act(RIGHT))
    seen = []
    while session.before is not None:
        session = obey(world, session, UNDO)
        seen.append((session.steps, session.now.move.orbit, len(session.now.styles)))
    assert seen == [(1, 5.0, 1), (1, 5.0, 0), (1, 0.0, 0), (0, 0.0, 0)]
    half = played(world, start, TAB, TAB, act(LEFT), UNDO)
    assert (half.pending, half.steps) == ((), 0)


def test_the_arrows_are_those_of_whoever_acts_next_seen_from_the_camera_of_now(world, start):
    learnt = {
        "player_1": (LearntAction("idle"), LearntAction("go", (1.0, 0.0), "world")),
        "player_2": (LearntAction("idle"),),
    }
    session = begin(set_stage(world, "small", start, learnt, Wishes()))
    assert session.arrows() == ("", "→")
    for _ in range(18):
        session = obey(world, session, ORBIT)
    # From the side of +x, what goes along +x comes towards the camera.
    assert session.arrows() == ("", "↓")
    assert obey(world, session, TAB).arrows() == ("",)


def test_undo_keeps_who_is_played(world, start):
    session = played(world, start, act(LEFT), TAB, UNDO)
    assert (session.player, session.steps) == ("player_2", 0)


def test_a_new_take_begins_at_the_start_with_the_same_player(world, start):
    session = played(world, start, TAB, act(LEFT), ORBIT, NEW)
    assert (session.steps, session.player, session.before) == (0, "player_2", None)
    assert session.now.move == CameraMove()


@pytest.mark.parametrize(("command", "named"), [(UNDO, "nothing to undo"), (AGAIN, "again")])
def test_what_makes_no_sense_now_is_refused_in_words(world, start, command, named):
    with pytest.raises(ShotError, match=named):
        played(world, start, command)


def test_one_player_alone_has_no_turns_and_nobody_to_borrow_from(tmp_path):
    world = small_world.small_environment(small_world.small_config(players=1))
    session = played(world, write_state(world, tmp_path / "s.json"), TAB, act(LEFT))
    assert (session.in_turn, session.steps) == (False, 1)
    with pytest.raises(ShotError, match="nobody else"):
        obey(world, session, BORROW)


def test_players_that_are_not_in_the_picture_are_not_played(world, tmp_path):
    seen = write_state(world, tmp_path / "s.json", hidden=("player_1",))
    session = played(world, seen, act(LEFT))
    assert session.stage.players == ("player_2",)
    assert session.now.told == {"player_2": LEFT}
    with pytest.raises(ShotError, match="player_1 is not in the picture"):
        stage_of(world, seen, styles={"player_2": StyleMix(1, None, "player_1", 1.0)})
    nobody = write_state(world, tmp_path / "n.json", hidden=world.playable_names)
    with pytest.raises(ShotError, match="player_1, player_2"):
        stage_of(world, nobody)


def test_the_camera_moves_about_the_middle_of_the_players_bodies(world, start):
    stage = stage_of(world, start)
    places = [stage.state[name].position.numpy() for name in stage.players]
    middle = (small_world.PLAYER.low[2] + small_world.PLAYER.high[2]) / 2
    np.testing.assert_allclose(stage.pivot, np.mean(places, axis=0) + [0, 0, middle], atol=1e-6)


def test_the_shot_of_a_session_has_a_key_where_an_action_changes(world, start):
    session = played(world, start, act(LEFT), act(LEFT), act(RIGHT), quality="balanced")
    shot = shot_of_session(session)
    assert (shot.fps, shot.frame_end, shot.quality) == (5.0, 4, "balanced")
    assert {track.name: track.actions for track in shot.objects} == {
        "player_1": ((1, LEFT), (3, RIGHT)),
        "player_2": ((1, IDLE),),
    }


def test_cameras_between_two_steps_lie_between_theirs(world, start):
    session = played(world, start, act(LEFT), ORBIT, ORBIT, act(LEFT), fps=10.0)
    shot, stage = shot_of_session(session), session.stage
    turns = (0.0, 5.0, 10.0, 10.0, 10.0)
    wanted = [moved_camera(stage.camera, stage.pivot, CameraMove(orbit=each)) for each in turns]
    assert list(shot.cameras) == wanted
    assert shot.track("player_1").actions == ((1, LEFT),)


def test_styles_are_keyed_where_they_change(world, start):
    session = played(world, start, act(LEFT), BORROW, act(LEFT), OWN, act(LEFT))
    mixes = shot_of_session(session).track("player_1").styles
    assert [(mix.frame, mix.object, mix.weight) for mix in mixes] == [
        (2, "player_2", 1.0),
        (3, "player_1", 0.0),
    ]


def test_a_wished_style_is_worn_from_the_first_frame_until_it_is_taken_off(world, start):
    styles = {"player_2": StyleMix(1, None, "player_1", 0.5)}
    session = played(world, start, TAB, act(LEFT), OWN, styles=styles)
    mixes = shot_of_session(session).track("player_2").styles
    assert [(mix.frame, mix.object, mix.weight) for mix in mixes] == [
        (1, "player_1", 0.5),
        (2, "player_2", 0.0),
    ]


LONG_PLAY = (
    act(LEFT), ORBIT, RAISE, act(RIGHT), BORROW, TAB, act(RIGHT), UNDO, NEARER, TAB, act(LEFT),
    act(IDLE), OWN, ORBIT, act(RIGHT), AGAIN,
)  # fmt: skip


@pytest.mark.parametrize("fps", [5.0, 10.0])
def test_rendering_the_shot_gives_every_frame_of_the_session_to_the_byte(
    world, start, tmp_path, fps
):
    live = LivePlay(world, stage_of(world, start, fps=fps, size=(20, 12)), tmp_path / "live")
    live.draw()
    for command in LONG_PLAY:
        live.do(command)
        live.draw()
    drawn = {path.name: path.read_bytes() for path in live.folder.glob("*.png")}
    assert len(drawn) == 1 + live.session.steps
    saved = live.save()
    assert int(fps / 5) * live.session.steps + 1 == len(saved.frames)
    shot = load_shot(saved.shot)
    report = render_shot(world, shot, tmp_path / "again")
    assert report.written == saved.frames
    for frame in saved.frames:
        again = frame_path(tmp_path / "again", frame).read_bytes()
        assert again == frame_path(live.folder, frame).read_bytes()
        assert drawn.get(f"{frame:04d}.png", again) == again
    assert render_shot(world, shot, live.folder).kept == saved.frames
    walked = prepare_shot(world, shot).rollout.states[:: int(fps / 5)]
    assert [each["player_1"].position.tolist() for each in walked] == saved.paths["player_1"]


def test_frames_show_the_camera_the_style_and_the_step(world, start, tmp_path):
    live = LivePlay(world, stage_of(world, start), tmp_path)
    seen = [live.draw()[1]]
    for command in (act(LEFT), ORBIT, BORROW):
        live.do(command)
        path, picture = live.draw()
        np.testing.assert_allclose(read_image(path), picture, atol=0.51 / 255)
        assert not any(np.array_equal(picture, each) for each in seen)
        seen.append(picture)
    assert sorted(path.name for path in live.folder.iterdir()) == ["0001.png", "0002.png"]


def test_the_frames_of_undone_steps_are_deleted(world, start, tmp_path):
    live = LivePlay(world, stage_of(world, start), tmp_path)
    for command in (act(LEFT), act(RIGHT), UNDO, UNDO):
        live.do(command)
        live.draw()
    assert [path.name for path in live.folder.iterdir()] == ["0001.png"]


def test_every_take_has_a_folder_of_its_own_also_beside_those_of_an_earlier_session(
    world, start, tmp_path
):
    (tmp_path / "take_1").mkdir()
    live = LivePlay(world, stage_of(world, start), tmp_path)
    live.draw()
    folders = [live.folder.name]
    live.do(NEW)
    folders.append(live.folder.name)
    assert folders == ["take_2", "take_3"]


def test_a_film_of_a_take_has_all_its_frames(world, start, tmp_path):
    live = LivePlay(world, stage_of(world, start, fps=10.0), tmp_path)
    live.do(act(LEFT))
    done = []
    saved = live.save(mp4=True, on_progress=lambda *each: done.append(each))
    assert saved.video.is_file()
    assert (saved.frames, done[-1]) == ((1, 2, 3), (3, 3))


def test_an_abandoned_take_keeps_its_shot_and_the_frames_that_were_drawn(world, start, tmp_path):
    live = LivePlay(world, stage_of(world, start, fps=10.0), tmp_path)
    live.draw()
    live.do(act(LEFT))
    live.draw()
    saved = live.abandon()
    assert saved.frames == (1, 3)
    assert Shot.from_json(saved.shot.read_text()).frame_end == 3


def test_a_live_frame_rate_that_splits_steps_is_refused_with_those_that_do_not(
    world, start, tmp_path
):
    for fps in (12.0, 2.5):
        with pytest.raises(ShotError, match="5, 10, 15"):
            LivePlay(world, stage_of(world, start, fps=fps), tmp_path)
    for wrong in ({"fps": 0.0}, {"fps": float("nan")}, {"quality": "best"}):
        with pytest.raises(ShotError, match="expected"):
            Wishes(**wrong)


def test_a_script_moves_its_camera_evenly_and_wears_its_styles_throughout(world, start):
    styles = {"player_2": StyleMix(1, None, "player_1", 0.7)}
    stage = stage_of(world, start, styles=styles, quality="draft")
    shot = shot_of_script(stage, {"player_1": [(LEFT, 4)]}, CameraMove(orbit=20.0, rise=1.0))
    shares = [CameraMove(20.0, 1.0) * (index / 4) for index in range(5)]
    wanted = [moved_camera(stage.camera, stage.pivot, share) for share in shares]
    assert list(shot.cameras) == wanted
    assert shot.quality == "draft"
    assert shot.track("player_2").actions == ()
    assert shot.track("player_2").styles == (styles["player_2"],)


def test_finished_frames_are_those_whose_inputs_have_not_changed(world, start, tmp_path):
    stage = stage_of(world, start)
    shot = shot_of_script(stage, {"player_1": [(LEFT, 3)]}, CameraMove())
    render_shot(world, shot, tmp_path, frames=[1, 3])
    assert finished_frames(world, shot, tmp_path) == (1, 3)
    other = shot_of_script(stage, {"player_1": [(RIGHT, 3)]}, CameraMove())
    assert finished_frames(world, other, tmp_path) == (1,)
