"""Paths follow their keys by themselves, from the changed frame on, and disturb nobody."""

import numpy as np
import pytest
from addon.live import Clock
from addon.stage import BOXES

bpy = pytest.importorskip("bpy")
from blender_addon import playables  # noqa: E402 - after the check for Blender
from blender_addon.bake import bake_of  # noqa: E402
from blender_addon.fcurves import curves_of  # noqa: E402
from blender_addon.playing import live_paths  # noqa: E402
from blender_addon.playing.live_paths import BUSY, UPDATING  # noqa: E402
from blender_addon.scene_bridge import playable_objects, sample_range  # noqa: E402
from blender_addon.worker.replies import WorkerCancelledError  # noqa: E402
from pe_runtime.contract.errors import WorkerError  # noqa: E402

pytestmark = pytest.mark.blender
IDLE_ACTION, LEFT, RIGHT, FORWARD = 0, 1, 2, 3


@pytest.fixture
def stage(environment):
    """Forty frames in which player 1 goes right from frame 1 on; nothing is baked yet."""
    environment.frame_end = 40
    playables.key_action(player(environment), 1, RIGHT)
    return environment


@pytest.fixture
def clock(stage):
    made = Clock()
    made.settle()
    yield made
    made.live.forget()


def player(scene, name="player_1"):
    return playable_objects(scene)[name]


def keys_of(scene, name="player_1"):
    """All numbers of all location keys, as bytes."""
    found = []
    for axis in range(3):
        points = curves_of(player(scene, name)).find("location", index=axis).keyframe_points
        for kind in ("co", "handle_left", "handle_right"):
            numbers = np.empty(2 * len(points), np.float32)
            points.foreach_get(kind, numbers)
            found.append(numbers.reshape(-1, 2))
    return np.concatenate(found, axis=1)


def expected(scene, addon):
    """The paths of an explicit bake."""
    return addon.rollout(bake_of(scene.playable_environment).shot).positions


def test_the_first_key_bakes_the_first_paths(stage, clock, addon):
    bake = bake_of(stage.playable_environment)
    np.testing.assert_array_equal(bake.paths["player_1"], expected(stage, addon)["player_1"])
    assert np.ptp(bake.paths["player_1"], axis=0)[0] > 1.0
    assert len(clock.shots) == 1 and clock.live.note(stage) == ""


def test_it_bakes_what_the_operator_bakes(stage, clock):
    by_itself = bake_of(stage.playable_environment)
    bpy.ops.playable.bake_paths()
    assert bake_of(stage.playable_environment).digest == by_itself.digest


def test_without_a_camera_the_scene_of_the_artist_is_named(stage, clock):
    stage.camera = None
    clock.settle()
    assert clock.live.note(stage).startswith(f"scene {stage.name!r} has no camera; add one")


def test_nothing_is_asked_where_nothing_has_changed(stage, clock):
    text = stage.playable_environment.bake_text.as_string()
    player(stage).select_set(True)
    stage.frame_set(17)
    clock.settle()
    assert len(clock.shots) == 1
    assert stage.playable_environment.bake_text.as_string() == text


def test_an_edited_key_changes_the_path_from_that_frame_on_only(stage, clock, addon):
    before, others = keys_of(stage), keys_of(stage, "player_2")
    playables.key_action(player(stage), 21, LEFT)
    clock.settle()
    after = keys_of(stage)
    assert before[:20].tobytes() == after[:20].tobytes()
    assert (before[24:] != after[24:]).any(axis=1).all()
    assert others.tobytes() == keys_of(stage, "player_2").tobytes()
    np.testing.assert_allclose(after[:, 1], expected(stage, addon)["player_1"][:, 0], rtol=1e-6)
    assert len(clock.shots) == 2


def test_keys_moved_by_hand_before_the_changed_frame_stay(stage, clock):
    points = curves_of(player(stage)).find("location", index=2).keyframe_points
    points[4].co[1], points[4].interpolation = 0.75, "BEZIER"
    playables.key_action(player(stage), 21, LEFT)
    clock.settle()
    points = curves_of(player(stage)).find("location", index=2).keyframe_points
    assert points[4].co[1] == 0.75 and points[4].interpolation == "BEZIER"
    assert len(points) == 40


def test_only_the_frames_from_the_change_on_are_sampled(stage, clock, monkeypatch):
    sampled, moment_at = [], live_paths.moment_at
    monkeypatch.setattr(
        live_paths,
        "moment_at",
        lambda scene, frame: sampled.append(frame) or moment_at(scene, frame),
    )
    playables.key_action(player(stage), 21, LEFT)
    clock.settle()
    assert sampled == list(range(21, 41))


def test_a_moved_camera_key_counts_from_the_key_before_it(stage, clock, monkeypatch):
    camera = stage.camera
    for frame, turn in ((1, 0.0), (11, 0.0), (31, 0.0)):
        camera.rotation_euler.z = turn
        camera.keyframe_insert("rotation_euler", index=2, frame=frame)
    for point in curves_of(camera).find("rotation_euler", index=2).keyframe_points:
        point.interpolation = "LINEAR"
    clock.settle()
    before = keys_of(stage)
    sampled, moment_at = [], live_paths.moment_at
    monkeypatch.setattr(
        live_paths,
        "moment_at",
        lambda scene, frame: sampled.append(frame) or moment_at(scene, frame),
    )
    curve = curves_of(camera).find("rotation_euler", index=2)
    curve.keyframe_points[2].co[1] = 1.5
    curve.update()
    clock.settle()
    assert sampled[0] == 11
    after = keys_of(stage)
    assert before[:11].tobytes() == after[:11].tobytes()
    assert (before[15:, 1] != after[15:, 1]).any()


def test_a_camera_without_keys_counts_from_the_start(stage, clock):
    stage.camera.rotation_euler.z += 0.5
    clock.settle()
    assert len(clock.shots) == 2
    camera = bake_of(stage.playable_environment).shot.camera_at(1)
    bpy.context.view_layer.update()
    now = sample_range(stage, [1])[0].camera
    np.testing.assert_array_equal(camera.world_from_camera, now.world_from_camera)


def test_what_moves_the_camera_counts_too(stage, clock):
    target = bpy.data.objects.new("target", None)
    stage.collection.objects.link(target)
    constraint = stage.camera.constraints.new("DAMPED_TRACK")
    constraint.target, constraint.track_axis = target, "TRACK_NEGATIVE_Z"
    clock.settle()
    target.location.x = 3.0
    clock.settle()
    constraint.influence = 0.5
    clock.settle()
    assert len(clock.shots) == 4
    bystander = bpy.data.objects.new("bystander", None)
    stage.collection.objects.link(bystander)
    clock.settle()
    assert len(clock.shots) == 4


@pytest.mark.parametrize("end", [30, 60])
def test_another_end_keeps_the_frames_that_both_ranges_have(stage, clock, end):
    before = keys_of(stage)
    stage.frame_end = end
    clock.run_until(lambda seconds: seconds == live_paths.IDLE and len(clock.shots) == 2)
    after, shared = keys_of(stage), min(end, 40)
    assert len(after) == end
    # The handles of the last one know of its new neighbour.
    assert before[: shared - 1].tobytes() == after[: shared - 1].tobytes()
    assert before[:shared, 1].tobytes() == after[:shared, 1].tobytes()


def test_another_pace_changes_all_frames(stage, clock):
    stage.render.fps = 20
    clock.run_until(lambda seconds: seconds == live_paths.IDLE and len(clock.shots) == 2)
    assert bake_of(stage.playable_environment).shot.fps == 20.0


def test_what_was_moved_but_not_keyed_stays_where_it_is(stage, clock):
    stage.camera.keyframe_insert("location", frame=1)
    clock.settle()
    stage.camera.location.x = 7.0
    stage.frame_current  # noqa: B018 - reading changes nothing either
    playables.key_action(player(stage), 21, LEFT)
    clock.settle()
    assert stage.camera.location.x == 7.0
    assert bake_of(stage.playable_environment).shot.camera_at(30).world_from_camera[0, 3] != 7.0


def test_no_scene_is_left_behind_and_the_frame_stays(stage, clock):
    stage.frame_set(13, subframe=0.25)
    playables.key_action(player(stage), 21, LEFT)
    clock.settle()
    assert len(bpy.data.scenes) == 1
    assert (stage.frame_current, stage.frame_subframe) == (13, 0.25)


def test_a_long_range_is_sampled_in_slices(stage, clock, monkeypatch):
    for limit in ("SLICE_SECONDS", "LONGEST_SLICE"):
        monkeypatch.setattr(live_paths, limit, 0.0005)
    stage.frame_end = 400
    ticks = clock.settle()
    assert ticks > 20 and len(keys_of(stage)) == 400


def test_a_change_while_the_worker_thinks_is_not_overwritten(stage, clock):
    playables.key_action(player(stage), 21, LEFT)
    clock.live.touch()
    clock.run_until(lambda _: clock.live._job is not None and clock.live._job.call is not None)
    playables.key_action(player(stage), 25, FORWARD)
    clock.settle()
    assert bake_of(stage.playable_environment).shot.action_at("player_1", 30) == FORWARD
    assert len(clock.shots) == 3


def test_several_edits_in_quick_succession_ask_once(stage, clock):
    for frame in range(10, 20):
        playables.key_action(player(stage), frame, frame % 4)
        clock.live.touch()
        assert clock.live.tick(clock.now) != BUSY
        clock.now += 0.1
    clock.settle()
    assert len(clock.shots) == 2


def test_switched_off_it_does_nothing(stage, clock):
    stage.playable_environment.playing.update_paths = False
    playables.key_action(player(stage), 21, LEFT)
    clock.settle()
    assert len(clock.shots) == 1


def test_a_failure_is_said_once_and_not_repeated(stage, clock):
    clock._predict = failing(WorkerError("the worker has a cold"))
    playables.key_action(player(stage), 21, LEFT)
    clock.settle()
    clock.settle()
    assert len(clock.shots) == 2
    assert clock.live.note(stage) == "the worker has a cold"
    clock._predict = lambda *a, **k: live_paths_session().rollout(*a, **k)
    playables.key_action(player(stage), 22, LEFT)
    clock.settle()
    assert clock.live.note(stage) == "" and len(clock.shots) == 3


def failing(error):
    def predict(*_, **__):
        raise error

    return predict


def live_paths_session():
    from blender_addon.worker.session import session

    return session


def test_who_had_to_make_way_tries_again(stage, clock):
    answers = [failing(WorkerCancelledError("somebody renders")), live_paths_session().rollout]
    clock._predict = lambda *a, **k: answers.pop(0)(*a, **k)
    playables.key_action(player(stage), 21, LEFT)
    clock.settle()
    assert len(clock.shots) == 3 and clock.live.note(stage) == ""
    assert bake_of(stage.playable_environment).shot.action_at("player_1", 30) == LEFT


def test_a_broken_scene_is_said_and_the_timer_lives(stage, clock):
    copy = player(stage).copy()
    stage.collection.objects.link(copy)
    clock.settle()
    assert "both stand for 'player_1'" in clock.live.note(stage)
    bpy.data.objects.remove(copy)
    clock.settle()
    assert clock.live.note(stage) == ""


def test_a_deleted_empty_leaves_its_object_to_rest(stage, clock):
    bpy.data.objects.remove(player(stage, "player_2"))
    clock.settle()
    bake = bake_of(stage.playable_environment)
    assert list(bake.paths) == ["player_1"]


def test_a_scene_that_is_deleted_on_the_way_is_forgotten(stage, clock):
    playables.key_action(player(stage), 21, LEFT)
    clock.live.touch()
    clock.run_until(lambda _: clock.live._job is not None)
    assert clock.live.note(stage) == UPDATING
    bpy.data.scenes.new("another")
    bpy.data.scenes.remove(stage)
    clock.settle()
    assert len(clock.shots) <= 2


def test_a_file_opened_on_the_way_is_left_alone(stage, clock, tmp_path):
    file = str(tmp_path / "saved.blend")
    bpy.ops.wm.save_as_mainfile(filepath=file)
    playables.key_action(player(stage), 21, LEFT)
    clock.live.touch()
    clock.run_until(lambda _: clock.live._job is not None)
    clock.live.forget()
    bpy.ops.wm.open_mainfile(filepath=file)
    scene = bpy.data.scenes[0]
    text = scene.playable_environment.bake_text.as_string()
    clock.settle()
    # It is looked at anew, found to be as baked, and not asked for again.
    assert len(clock.shots) <= 2 and scene.playable_environment.bake_text.as_string() == text
    playables.key_action(player(scene), 31, LEFT)
    clock.settle()
    assert bake_of(scene.playable_environment).shot.action_at("player_1", 35) == LEFT


def test_going_back_to_an_earlier_bake_asks_for_nothing(stage, clock):
    """As after undo, which brings back keys, paths and the bake together."""
    text = stage.playable_environment.bake_text
    early = text.as_string()
    playables.key_action(player(stage), 21, LEFT)
    clock.settle()
    curve = curves_of(player(stage)).find(playables.ACTION_PATH)
    curve.keyframe_points.remove(curve.keyframe_points[1])
    text.clear()
    text.write(early)
    clock.settle()
    assert len(clock.shots) == 2


def test_two_environments_in_one_file_follow_their_own_keys(stage, clock, picture):
    import json

    other = bpy.data.scenes.new("second")
    other.frame_start, other.frame_end, other.render.fps = 1, 10, 10
    with bpy.context.temp_override(scene=other, view_layer=other.view_layers[0]):
        other.camera = stage.camera
        other.collection.objects.link(stage.camera)
        bpy.ops.playable.new_environment(image=str(picture), model="fake", boxes=json.dumps(BOXES))
    clock.settle()
    assert bake_of(other.playable_environment).shot.frame_end == 10
    asked = len(clock.shots)
    playables.key_action(player(other), 5, LEFT)
    clock.settle()
    assert len(clock.shots) == asked + 1 and clock.shots[-1].frame_end == 10
