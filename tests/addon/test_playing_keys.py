"""Buttons, number keys and who stands for whom."""

import json

import pytest
from addon.stage import BOXES

bpy = pytest.importorskip("bpy")
from blender_addon import playables  # noqa: E402 - after the check for Blender
from blender_addon.fcurves import curves_of  # noqa: E402
from blender_addon.playing import directions  # noqa: E402
from blender_addon.playing.action_keys import keyed_frames, next_playable  # noqa: E402
from blender_addon.playing.claims import free_names, left_out, other_claims  # noqa: E402
from blender_addon.playing.directions import direction_icons  # noqa: E402
from blender_addon.playing.keymap import ACT, DELETE, EDITORS, NEXT  # noqa: E402
from blender_addon.scene_bridge import action_names, playable_objects  # noqa: E402

pytestmark = pytest.mark.blender
PLAY = bpy.ops.playable


@pytest.fixture
def players(environment):
    found = playable_objects(environment)
    choose(found["player_1"])
    return found


def choose(*chosen):
    layer = bpy.context.view_layer
    for each in layer.objects:
        each.select_set(each in chosen)
    layer.objects.active = chosen[0]


def keys_of(target):
    curve = curves_of(target).find(playables.ACTION_PATH)
    return [tuple(point.co) for point in curve.keyframe_points]


def test_a_press_keys_the_action_at_the_current_frame(environment, players):
    environment.frame_set(3)
    assert PLAY.do_action(action=2) == {"FINISHED"}
    assert keys_of(players["player_1"]) == [(3.0, 2.0)]
    assert players["player_1"].playable.action == "A2"
    assert curves_of(players["player_2"]) is None


def test_all_selected_players_are_keyed(environment, players):
    choose(players["player_1"], players["player_2"], environment.camera)
    PLAY.do_action(action=1)
    assert keys_of(players["player_1"]) == keys_of(players["player_2"]) == [(1.0, 1.0)]


def test_a_number_beyond_the_models_actions_keys_nothing(players):
    assert PLAY.do_action(action=6) == {"CANCELLED"}
    assert curves_of(players["player_1"]) is None


def test_buttons_and_keys_wait_for_a_playable_empty(environment, players):
    choose(environment.camera)
    for operator in (PLAY.do_action, PLAY.delete_action_key, PLAY.next_object):
        assert not operator.poll()
    choose(players["player_2"])
    assert PLAY.do_action.poll() and PLAY.next_object.poll()


def test_number_keys_stand_in_the_editors_and_leave_with_the_addon(addon):
    keymaps = bpy.context.window_manager.keyconfigs.addon.keymaps
    import blender_addon

    for name, _ in EDITORS:
        items = [item for item in keymaps[name].keymap_items if item.idname == ACT]
        assert [(item.type, item.properties.action) for item in items][:2] == [
            ("ONE", 0),
            ("TWO", 1),
        ]
        assert len(items) == 9
    blender_addon.unregister()
    left = {item.idname for keymap in keymaps for item in keymap.keymap_items}
    assert not left & {ACT, DELETE, NEXT}
    blender_addon.register()


def test_a_key_is_deleted_at_its_frame_only(environment, players):
    target = players["player_1"]
    for frame, action in ((1, 1), (3, 2)):
        playables.key_action(target, frame, action)
    environment.frame_set(2)
    assert not PLAY.delete_action_key.poll()
    environment.frame_set(3)
    PLAY.delete_action_key()
    assert keys_of(target) == [(1.0, 1.0)]
    environment.frame_set(1)
    PLAY.delete_action_key()
    assert keyed_frames(target) == []


def test_one_goes_from_key_to_key(environment, players):
    for name, frame in (("player_1", 2), ("player_1", 4), ("player_2", 3)):
        playables.key_action(players[name], frame, 1)
    environment.frame_set(1)
    visited = []
    while PLAY.jump_to_action_key(forward=True) == {"FINISHED"}:
        visited.append(environment.frame_current)
    assert visited == [2, 4]
    choose(players["player_1"], players["player_2"])
    PLAY.jump_to_action_key(forward=False)
    assert environment.frame_current == 3


def test_tab_goes_round_the_players_that_are_seen(environment, players):
    PLAY.next_object()
    assert bpy.context.view_layer.objects.active == players["player_2"]
    assert list(bpy.context.view_layer.objects.selected) == [players["player_2"]]
    PLAY.next_object()
    assert bpy.context.view_layer.objects.active == players["player_1"]
    players["player_2"].hide_set(True)
    assert next_playable(bpy.context.view_layer, players["player_1"]) == players["player_1"]


def test_arrows_tell_where_an_action_leads():
    moves = [[0.0, 0.01], [-1.0, 0.3], [0.9, -0.2], [0.1, 1.0], [0.2, -0.8], [0.0, 0.0]]
    assert direction_icons(json.dumps(moves), 6) == (
        directions.STAY,
        directions.LEFT,
        directions.RIGHT,
        directions.AHEAD,
        directions.BACK,
        directions.STAY,
    )
    assert direction_icons("", 2) == direction_icons("[]", 2) == (directions.UNKNOWN,) * 2
    known = bpy.types.UILayout.bl_rna.functions["prop"].parameters["icon"].enum_items.keys()
    assert {directions.STAY, directions.LEFT, directions.RIGHT, directions.AHEAD} <= set(known)


def test_empties_know_the_movements_of_their_actions(environment, players, addon):
    facts = addon.facts("fake")
    learnt = json.loads(players["player_1"].playable.action_movements)
    assert learnt == [list(each) for each in facts.movements["player_1"]]
    assert len(learnt) == len(action_names(players["player_1"]))


def test_a_duplicate_is_told_and_put_right_with_one_click(environment, players, picture):
    copy = players["player_1"].copy()
    environment.collection.objects.link(copy)
    choose(copy)
    assert other_claims(environment, copy) == [players["player_1"].name]
    assert free_names(environment, copy) == []
    assert not PLAY.stand_for.poll()
    PLAY.make_not_playable()
    assert playable_objects(environment) == players


def test_a_duplicate_may_stand_for_whoever_is_left_out(environment, players):
    playables.key_action(players["player_1"], 1, 1)
    bpy.data.objects.remove(players["player_2"])
    copy = players["player_1"].copy()
    environment.collection.objects.link(copy)
    choose(copy)
    assert left_out(environment) == free_names(environment, copy) == ["player_2"]
    PLAY.stand_for(object_name="player_2")
    assert playable_objects(environment)["player_2"] == copy
    # From its next key on it has keys of its own.
    PLAY.do_action(action=3)
    assert keys_of(players["player_1"]) == [(1.0, 1.0)]
    assert keys_of(copy) == [(1.0, 3.0)]


def test_a_deleted_empty_can_be_brought_back(environment, players):
    before = tuple(players["player_2"].location)
    bpy.data.objects.remove(players["player_2"])
    PLAY.bring_back(object_name="player_2")
    again = playable_objects(environment)["player_2"]
    assert tuple(again.location) == before and action_names(again)
    assert left_out(environment) == []
    with pytest.raises(RuntimeError, match="'player_2' is no object of the picture that lacks"):
        PLAY.bring_back(object_name="player_2")


def test_a_renamed_empty_still_stands_for_its_object(environment, players):
    players["player_1"].name = "The Champion"
    assert playable_objects(environment)["player_1"].name == "The Champion"
    assert left_out(environment) == [] and set(BOXES) == set(playable_objects(environment))
