"""Leaving the predicted path by keys that baking respects, and following it again."""

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")
from blender_addon import playables  # noqa: E402 - after the check for Blender
from blender_addon.bake import bake_of  # noqa: E402
from blender_addon.fcurves import curves_of, key_points  # noqa: E402
from blender_addon.scene_bridge import playable_objects, sample_range  # noqa: E402

pytestmark = pytest.mark.blender
FRAMES = 10


@pytest.fixture
def baked(environment):
    environment.frame_end = FRAMES
    target = playable_objects(environment)["player_1"]
    playables.key_action(target, 1, 1)
    bpy.context.view_layer.objects.active = target
    bpy.ops.playable.bake_paths()
    return environment


def player(scene):
    return playable_objects(scene)["player_1"]


def heights(scene):
    moments = sample_range(scene, range(1, FRAMES + 1))
    return [round(moment.tracks["player_1"].location[2], 4) for moment in moments]


def off_path(scene):
    """The frames at which the first player does not stand where it was predicted."""
    path = bake_of(scene.playable_environment).paths["player_1"]
    moments = sample_range(scene, range(1, FRAMES + 1))
    places = np.array([moment.tracks["player_1"].location for moment in moments])
    return [index + 1 for index in np.flatnonzero(np.abs(places - path).max(axis=1) > 1e-4)]


def lift(scene, frame, height):
    scene.frame_set(frame)
    player(scene).location.z = height
    player(scene).keyframe_insert("location", frame=frame)


def leave(scene, frame=4, lifted=8):
    scene.frame_set(frame)
    bpy.ops.playable.leave_path()
    lift(scene, lifted, 1.0)


def test_an_object_that_leaves_its_path_goes_where_it_is_keyed(baked):
    leave(baked)
    assert heights(baked)[:4] == [0.0] * 4 and heights(baked)[7:] == [1.0] * 3
    assert 0.2 < heights(baked)[5] < 0.8
    frames = key_points(curves_of(player(baked)).find("location", index=2))[:, 0]
    assert frames.tolist() == [1, 2, 3, 4, 8]


def test_baking_again_keys_the_path_and_leaves_the_free_frames_alone(baked):
    leave(baked)
    before = heights(baked)
    playables.key_action(player(baked), 1, 2)
    baked.frame_set(1)
    bpy.ops.playable.bake_paths()
    assert heights(baked) == before
    # The path has changed since it was left.
    assert off_path(baked) == list(range(4, FRAMES + 1))
    baked.frame_set(8)
    bpy.ops.playable.follow_path(extent="ALL")
    assert (
        off_path(baked) == [] and curves_of(player(baked)).find("playable.overrides.place") is None
    )


def test_following_again_from_here_on_keeps_what_came_before(baked):
    leave(baked)
    baked.frame_set(9)
    bpy.ops.playable.follow_path(extent="ONWARDS")
    assert off_path(baked) == [5, 6, 7, 8]
    bpy.ops.playable.bake_paths()
    assert off_path(baked) == [5, 6, 7, 8]


def test_following_again_at_one_frame_leaves_the_others_free(baked):
    leave(baked)
    baked.frame_set(6)
    bpy.ops.playable.follow_path(extent="FRAME")
    # Between two keys on the path it may well stand on it.
    assert off_path(baked) == [7, 8, 9, 10]
    bpy.ops.playable.bake_paths()
    # Between two keys on the path it may well stand on it.
    assert off_path(baked) == [7, 8, 9, 10]


def test_a_slip_on_the_path_is_taken_back_at_its_frame(baked):
    lift(baked, 3, 0.5)
    lift(baked, 7, 0.5)
    assert off_path(baked) == [3, 7]
    baked.frame_set(3)
    bpy.ops.playable.follow_path(extent="FRAME")
    assert off_path(baked) == [7]


def test_leaving_twice_and_following_beyond_the_bake_are_refused_with_a_reason(baked):
    leave(baked)
    with pytest.raises(RuntimeError, match="free of its path at frame 8 already"):
        bpy.ops.playable.leave_path()
    baked.frame_set(30)
    with pytest.raises(RuntimeError, match="frame 30 is outside the baked range 1 to 10"):
        bpy.ops.playable.follow_path(extent="FRAME")


def test_a_second_stretch_of_freedom_ends_where_the_next_follow_key_is(baked):
    leave(baked, 6, 8)
    baked.frame_set(9)
    bpy.ops.playable.follow_path(extent="ONWARDS")
    baked.frame_set(2)
    bpy.ops.playable.leave_path()
    lift(baked, 4, 2.0)
    # The next key of Place is the Follow of frame 5, before the second stretch.
    assert off_path(baked) == [3, 4, 7, 8]
    assert heights(baked)[3] == 2.0 and heights(baked)[8:] == [0.0, 0.0]


def test_an_object_without_actions_goes_back_without_keys(environment, picture):
    import json

    from addon.stage import BOXES

    bpy.ops.playable.new_environment(image=str(picture), model="still", boxes=json.dumps(BOXES))
    environment.frame_end = FRAMES
    bpy.ops.playable.bake_paths()
    bpy.context.view_layer.objects.active = player(environment)
    lift(environment, 3, 0.5)
    assert off_path(environment) == list(range(1, FRAMES + 1))
    bpy.ops.playable.follow_path(extent="ALL")
    assert off_path(environment) == []
    assert curves_of(player(environment)).find("location", index=2) is None


def test_without_a_bake_or_a_playable_object_the_buttons_say_why(environment):
    bpy.context.view_layer.objects.active = player(environment)
    with pytest.raises(RuntimeError, match="Nothing is baked yet"):
        bpy.ops.playable.follow_path()
    bpy.context.view_layer.objects.active = environment.camera
    with pytest.raises(RuntimeError, match="Select a playable Empty first"):
        bpy.ops.playable.leave_path()
