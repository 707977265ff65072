"""Actions hold from key to key whatever is done to their keys, and what blends them is named."""

import pytest

bpy = pytest.importorskip("bpy")
from blender_addon import playables  # noqa: E402 - after the check for Blender
from blender_addon.fcurves import ACTION_PATH, curves_of, own_curves  # noqa: E402
from blender_addon.playing.stepping import action_warnings, step_actions  # noqa: E402
from blender_addon.scene_bridge import playable_objects, sample_range  # noqa: E402
from pe_runtime.contract.errors import ShotError  # noqa: E402

pytestmark = pytest.mark.blender


@pytest.fixture
def target(environment):
    environment.frame_end = 11
    return playable_objects(environment)["player_1"]


def api_curve(target, interpolation="LINEAR", keys=((1, 0), (11, 5))):
    """A curve as scripts and importers make it: without Blender's mark of a discrete one."""
    curve = own_curves(target).new(ACTION_PATH)
    for frame, action in keys:
        point = curve.keyframe_points.insert(frame, action)
        point.interpolation = interpolation
    curve.update()
    return curve


def actions(scene):
    return [m.tracks["player_1"].action for m in sample_range(scene, range(1, 12))]


@pytest.mark.parametrize("interpolation", ["LINEAR", "BEZIER", "BOUNCE"])
def test_keys_of_scripts_are_read_as_if_they_held(environment, target, interpolation):
    api_curve(target, interpolation)
    assert actions(environment) == [0] * 10 + [5]


def test_without_that_they_would_pass_through_others(environment, target):
    """Blender itself does step through the numbers between: what the test above guards against."""
    api_curve(target)
    environment.frame_set(6)
    assert target.playable.action not in ("A0", "A5")


def test_an_engine_reads_them_so_too(environment, target):
    from blender_addon.scene_bridge import read_moment

    api_curve(target)
    environment.frame_set(6)
    moment = read_moment(environment.view_layers[0].depsgraph)
    assert moment.tracks["player_1"].action == 0


def test_a_repair_makes_all_keys_hold_and_touches_only_what_needs_it(environment, target):
    curve = api_curve(target)
    assert step_actions(environment) == 1
    assert {point.interpolation for point in curve.keyframe_points} == {"CONSTANT"}
    assert step_actions(environment) == 0
    environment.frame_set(6)
    assert target.playable.action == "A0"


def test_baking_repairs_first(environment, target):
    curve = api_curve(target)
    bpy.ops.playable.bake_paths()
    assert {point.interpolation for point in curve.keyframe_points} == {"CONSTANT"}


def push_down(target):
    """As the NLA editor's button does."""
    animation = target.animation_data
    track = animation.nla_tracks.new()
    slot = animation.action_slot
    strip = track.strips.new("moves", 1, animation.action)
    strip.action_slot = slot
    animation.action = None
    return track, strip


def test_keys_in_nla_strips_are_made_to_hold(environment, target):
    api_curve(target)
    push_down(target)
    assert step_actions(environment) == 1
    assert actions(environment) == [0] * 10 + [5]
    assert action_warnings(environment) == []


def test_copied_keys_are_made_to_hold(environment, target):
    other = playable_objects(environment)["player_2"]
    playables.key_action(target, 1, 1)
    curve = api_curve(other, keys=())
    for source in curves_of(target).find(ACTION_PATH).keyframe_points:
        curve.keyframe_points.insert(source.co[0], source.co[1]).interpolation = "BEZIER"
    curve.keyframe_points.insert(9, 4)
    assert step_actions(environment) == 1


def test_a_modifier_keeps_its_say_after_the_repair(environment, target):
    curve = api_curve(target, keys=((1, 0), (3, 2), (4, 0)))
    curve.modifiers.new("CYCLES")
    step_actions(environment)
    assert actions(environment)[:8] == [0, 0, 2, 0, 0, 2, 0, 0]


def test_an_unknown_action_is_named(environment, target):
    api_curve(target, keys=((1, 0), (5, 17)))
    with pytest.raises(ShotError, match="action key beyond the model's 6 actions"):
        actions(environment)


class TestWarnings:
    @pytest.fixture
    def strip(self, environment, target):
        api_curve(target, "CONSTANT")
        return push_down(target)[1]

    def one(self, scene, text):
        (found,) = action_warnings(scene)
        assert text in found and "'player_1'" in found

    def test_a_strip_that_only_plays_is_fine(self, environment, strip):
        assert action_warnings(environment) == []

    def test_partial_influence(self, environment, strip):
        strip.use_animated_influence = True
        strip.influence = 0.6
        strip.keyframe_insert("influence", frame=1)
        self.one(environment, "influence below 1")

    def test_blending_in(self, environment, strip):
        strip.blend_in = 3.0
        self.one(environment, "blends in or out")

    def test_adding(self, environment, strip):
        strip.blend_type = "ADD"
        self.one(environment, "choose Replace")

    def test_a_muted_track(self, environment, target, strip):
        target.animation_data.nla_tracks[0].mute = True
        self.one(environment, "muted")

    def test_a_track_beside_a_solo_one(self, environment, target, strip):
        target.animation_data.nla_tracks.new().is_solo = True
        self.one(environment, "muted")

    def test_keys_over_strips_with_half_a_say(self, environment, target, strip):
        playables.key_action(target, 5, 2)
        assert action_warnings(environment) == []
        target.animation_data.action_influence = 0.5
        self.one(environment, "influence below 1")

    def test_a_muted_curve_and_a_driver(self, environment):
        other = playable_objects(environment)["player_2"]
        api_curve(other).mute = True
        (found,) = action_warnings(environment)
        assert "'player_2'" in found and "muted" in found
        other.driver_add(ACTION_PATH)
        assert any("driver" in text for text in action_warnings(environment))

    def test_the_bake_says_it(self, environment, strip, capfd):
        strip.blend_in = 3.0
        bpy.ops.playable.bake_paths()
        assert "blends in or out" in capfd.readouterr().out
