"""Styles, poses and places that are keyed, read at every frame and drawn without another bake."""

import json

import numpy as np
import pytest
from addon.stage import BOXES, HEIGHT, WIDTH, read_png

bpy = pytest.importorskip("bpy")
from blender_addon import playables  # noqa: E402 - after the check for Blender
from blender_addon.bake import (  # noqa: E402
    Output,
    bake_of,
    is_as_baked,
    take_as_baked,
    take_of_moment,
)
from blender_addon.overrides.key_history import held_since  # noqa: E402
from blender_addon.scene_bridge import playable_objects, sample_range  # noqa: E402
from pe_runtime.contract.errors import ShotError  # noqa: E402
from pe_runtime.contract.shot import PoseKey, StyleMix  # noqa: E402

pytestmark = pytest.mark.blender
OUTPUT = Output(WIDTH, HEIGHT)
FRAMES = 8


@pytest.fixture
def baked(environment):
    environment.frame_end = FRAMES
    playables.key_action(playable_objects(environment)["player_1"], 1, 1)
    bpy.ops.playable.bake_paths()
    return environment


def player(scene, name="player_1"):
    return playable_objects(scene)[name]


def key(target, member, frame, value):
    setattr(target.playable.overrides, member, value)
    target.keyframe_insert(f"playable.overrides.{member}", frame=frame)


def takes(scene, frames=range(1, FRAMES + 1)):
    bake = bake_of(scene.playable_environment)
    return [take_of_moment(bake, each, 10.0, OUTPUT) for each in sample_range(scene, frames)]


def tracks(scene, name="player_1"):
    return [take.track(name) for take in takes(scene)]


def render_still(scene, path, frame=1):
    scene.frame_set(frame)
    scene.render.image_settings.color_mode = "RGB"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True, scene=scene.name)
    return read_png(path)


def test_without_overrides_every_frame_is_as_baked(baked):
    bake = bake_of(baked.playable_environment)
    for take in takes(baked):
        assert is_as_baked(bake, take, OUTPUT)
        assert take == take_as_baked(bake, take.frame_start, OUTPUT)


def test_a_pose_is_held_from_its_key_to_the_next_one(baked):
    for frame, pose in ((1, "FREE"), (3, "HELD"), (6, "FREE"), (8, "HELD")):
        key(player(baked), "pose", frame, pose)
    held = [PoseKey(frame, 3) for frame in (4, 5)]
    # Where holding begins the pose is the predicted one, and nothing has to be asked for.
    assert [track.poses for track in tracks(baked)] == [
        (), (), (), (held[0],), (held[1],), (), (), ()
    ]  # fmt: skip
    assert all(track.poses == () for track in tracks(baked, "player_2"))
    bake = bake_of(baked.playable_environment)
    assert [is_as_baked(bake, take, OUTPUT) for take in takes(baked)] == [
        True, True, True, False, False, True, True, True
    ]  # fmt: skip


def test_a_pose_that_is_held_without_keys_is_that_of_the_first_baked_frame(baked):
    player(baked).playable.overrides.pose = "HELD"
    found = [track.poses for track in tracks(baked)]
    assert found == [(), *[(PoseKey(frame, 1),) for frame in range(2, FRAMES + 1)]]
    # A narrower range of the scene is a part of the same film.
    baked.frame_start = 5
    assert tracks(baked)[6].poses == (PoseKey(7, 1),)


def test_holding_that_began_before_the_bake_keeps_its_first_pose(baked):
    key(player(baked), "pose", -20, "FREE")
    key(player(baked), "pose", -10, "HELD")
    assert held_since(player(baked), 3) == -10
    assert tracks(baked)[2].poses == (PoseKey(3, 1),)


def test_a_single_key_holds_from_its_frame_on_and_not_before(baked):
    key(player(baked), "pose", 4, "HELD")
    assert [track.poses for track in tracks(baked)][:5] == [(), (), (), (), (PoseKey(5, 4),)]


def test_since_when_a_pose_is_held_is_told_by_keys_and_nla_strips_too(baked):
    target = player(baked)
    key(target, "pose", 1, "HELD")
    key(target, "pose", 3, "FREE")
    key(target, "pose", 5, "HELD")
    assert [held_since(target, frame) for frame in (-4, 1, 2, 5, 8)] == [None, 1, 1, 5, 5]
    animation = target.animation_data
    action, slot = animation.action, animation.action_slot
    strip = animation.nla_tracks.new().strips.new("down", 2, action)
    strip.action_slot = slot
    animation.action = None
    # The strip begins with frame 1 of the action at frame 2 of the scene.
    assert held_since(target, 8) == 6
    assert [track.poses for track in tracks(baked)][6:] == [(PoseKey(7, 6),), (PoseKey(8, 6),)]


def test_a_pose_that_a_driver_decides_is_refused(baked):
    driver = player(baked).driver_add("playable.overrides.pose").driver
    driver.expression = "1"
    with pytest.raises(ShotError, match="held at frame 1 by a driver"):
        takes(baked)


def test_the_hold_button_keys_the_pose_and_frees_it_again(baked):
    bpy.context.view_layer.objects.active = player(baked)
    baked.frame_set(3)
    bpy.ops.playable.hold_pose()
    baked.frame_set(5)
    bpy.ops.playable.hold_pose(hold=False)
    assert [track.poses for track in tracks(baked)][2:6] == [(), (PoseKey(4, 3),), (), ()]
    assert player(baked).playable.overrides.pose == "FREE"


def lend(scene, taker="player_1", number=3):
    own = player(scene, taker).playable.overrides
    own.style, own.style_object = "OBJECT", f"L{number}"
    return own


def test_a_style_from_another_object_is_mixed_by_a_key_at_every_frame(baked):
    lend(baked)
    key(player(baked), "style_mix", 2, 0.0)
    key(player(baked), "style_mix", 6, 1.0)
    found = [track.styles for track in tracks(baked)]
    assert found[0] == found[1] == ()
    assert [mix.object for (mix,) in found[2:]] == ["player_2"] * 6
    weights = [mix.weight for (mix,) in found[2:]]
    assert weights == sorted(weights) and 0 < weights[0] < weights[1] < 1
    assert weights[3:] == [1.0] * 3


def test_a_mix_beyond_its_range_is_clamped(baked):
    lend(baked)
    key(player(baked), "style_mix", 1, 1.0)
    key(player(baked), "style_mix", 8, 1.0)
    curve = playables.own_curves(player(baked)).find("playable.overrides.style_mix")
    for point in curve.keyframe_points:
        point.handle_left_type = point.handle_right_type = "FREE"
        for handle in ("handle_left", "handle_right"):
            setattr(point, handle, (getattr(point, handle)[0], 9.0))
    curve.update()
    assert {track.styles[0].weight for track in tracks(baked)} == {1.0}


def test_objects_that_lend_are_others_of_the_same_class_in_the_picture(baked):
    own = player(baked).playable.overrides
    own.style_object = "L3"
    with pytest.raises(TypeError, match="L1"):
        own.style_object = "L1"
    with pytest.raises(TypeError, match="L2"):
        own.style_object = "L2"
    own.style = "OBJECT"
    assert tracks(baked)[0].styles == (StyleMix(1, None, "player_2", 1.0),)


def test_a_style_of_which_nothing_is_chosen_stays_its_own(baked):
    for style in ("OBJECT", "PICTURE"):
        player(baked).playable.overrides.style = style
        assert tracks(baked)[0].styles == ()


def test_a_style_key_switches_from_one_frame_to_the_next(baked):
    target = player(baked)
    target.playable.overrides.style_object = "L3"
    key(target, "style", 1, "OWN")
    key(target, "style", 4, "OBJECT")
    assert [bool(track.styles) for track in tracks(baked)] == [False] * 3 + [True] * 5


def test_styles_and_poses_change_the_frames_that_are_drawn(baked, tmp_path):
    before = render_still(baked, tmp_path / "before.png", 5)
    key(player(baked), "pose", 1, "FREE")
    key(player(baked), "pose", 2, "HELD")
    held = render_still(baked, tmp_path / "held.png", 5)
    lend(baked)
    styled = render_still(baked, tmp_path / "styled.png", 5)
    assert not np.array_equal(before, held) and not np.array_equal(held, styled)
    player(baked).playable.overrides.style = "OWN"
    key(player(baked), "pose", 2, "FREE")
    assert np.array_equal(render_still(baked, tmp_path / "again.png", 5), before)


def test_overrides_survive_saving_and_loading(baked, tmp_path):
    lend(baked).style_mix = 0.25
    key(player(baked), "pose", 3, "HELD")
    file = str(tmp_path / "saved.blend")
    bpy.ops.wm.save_as_mainfile(filepath=file)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=file)
    found = takes(bpy.data.scenes[0])[4].track("player_1")
    assert found.poses == (PoseKey(5, 3),)
    assert found.styles == (StyleMix(5, None, "player_2", 0.25),)


def test_the_state_of_the_scene_decides_who_is_of_one_class(baked):
    settings = baked.playable_environment
    content = json.loads(settings.state_text.as_string())
    lend(baked)
    content["state"]["objects"]["player_2"]["style"] = [0.5, 0.5]
    playables.write_text(settings.state_text, "", json.dumps(content))
    with pytest.raises(ShotError, match="'player_1' cannot take the style of 'player_2': it has 1"):
        sample_range(baked, [1])
    del content["state"]["objects"]["player_2"]
    playables.write_text(settings.state_text, "", json.dumps(content))
    with pytest.raises(ShotError, match="does not show; choose another one"):
        sample_range(baked, [1])
    assert set(BOXES) == set(playable_objects(baked))


def test_a_library_override_keeps_its_own_overrides_and_keys(baked, tmp_path):
    library = str(tmp_path / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=library)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with bpy.data.libraries.load(library, link=True) as (_, wanted):
        wanted.objects = ["player_1"]
    linked = bpy.data.objects["player_1"]
    bpy.context.view_layer.objects.active = None
    local = linked.override_create()
    bpy.context.scene.collection.objects.link(local)
    own = local.playable.overrides
    own.style, own.style_mix, own.place = "OBJECT", 0.25, "FREE"
    bpy.context.view_layer.objects.active = local
    bpy.context.scene.frame_set(3)
    bpy.ops.playable.hold_pose()
    file = str(tmp_path / "shot.blend")
    bpy.ops.wm.save_as_mainfile(filepath=file)
    bpy.ops.wm.open_mainfile(filepath=file)
    again = next(each for each in bpy.data.objects if each.override_library)
    found = again.playable.overrides
    assert (found.style, found.style_mix, found.place) == ("OBJECT", 0.25, "FREE")
    assert held_since(again, 5) == 3
    assert again.animation_data.action.library is None
