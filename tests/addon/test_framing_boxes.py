"""Boxes of playable objects: found, drawn, typed, tracked; and what is said before encoding."""

import json

import numpy as np
import pytest
from addon.stage import BOXES, FAKE, HEIGHT, WIDTH

bpy = pytest.importorskip("bpy")
from blender_addon.framing.framed import framed_picture  # noqa: E402 - after the check for Blender
from blender_addon.framing.readiness import all_missing, missing  # noqa: E402
from blender_addon.framing.settings import read_facts  # noqa: E402
from blender_addon.framing.tracked_boxes import tracked_box  # noqa: E402
from blender_addon.scene_bridge import playable_objects  # noqa: E402
from pe_runtime.contract.errors import ShotError  # noqa: E402

pytestmark = pytest.mark.blender


@pytest.fixture
def settings(scene, picture):
    """The scene's settings with the fake model loaded and the picture's file."""
    found = scene.playable_environment
    found.model, found.image_path = "fake", str(picture)
    bpy.ops.playable.load_model()
    return found


def boxes_of(settings):
    return {name: pytest.approx(box, abs=1e-4) for name, box in settings.typed_boxes().items()}


def test_boxes_are_detected(settings, capfd):
    bpy.ops.playable.detect_boxes()
    assert set(settings.typed_boxes()) == set(BOXES) and settings.framing.is_open
    assert "found player_1 (" in capfd.readouterr().out


def test_a_box_that_was_drawn_stays_where_nobody_is_found(settings, monkeypatch):
    from blender_addon.worker import questions
    from blender_addon.worker.replies import DetectedBoxes

    settings.boxes["player_2"].box = BOXES["player_2"]
    found = DetectedBoxes({"player_1": (1.0, 2.0, 70.0, 20.0)}, {"player_1": 0.5})
    monkeypatch.setattr(questions, "detect", lambda *_: found)
    bpy.ops.playable.detect_boxes()
    assert settings.typed_boxes() == {"player_1": (1, 2, 64, 20), "player_2": BOXES["player_2"]}


def test_without_a_detector_the_button_says_so(settings):
    fields = json.loads(settings.framing.facts_text) | {"detects": False}
    settings.framing.facts_text = json.dumps(fields)
    with pytest.raises(RuntimeError, match="no detector installed; draw the boxes instead"):
        bpy.ops.playable.detect_boxes()


def test_detecting_loads_the_model_by_itself(scene, picture):
    settings = scene.playable_environment
    settings.model, settings.image_path = "fake", str(picture)
    bpy.ops.playable.detect_boxes()
    assert [each.name for each in settings.boxes] == list(BOXES)
    assert settings.framing.facts.playable_names == tuple(BOXES)


def test_a_box_can_be_drawn_without_a_window_and_is_cut_at_the_border(settings):
    bpy.ops.playable.draw_boxes(object="player_2", box=(50, 10, 99, 30))
    assert settings.typed_boxes() == {"player_2": (50, 10, 64, 30)}
    with pytest.raises(RuntimeError, match="no area"):
        bpy.ops.playable.draw_boxes(object="player_2", box=(9, 9, 9, 9))
    with pytest.raises(RuntimeError, match="no object 'player_9' to draw; there are player_1"):
        bpy.ops.playable.draw_boxes(object="player_9", box=(50, 10, 60, 30))


@pytest.fixture
def clip(picture):
    found = bpy.data.movieclips.load(str(picture))
    found.tracking.tracks.new(name="left", frame=1)
    for name, place in {"a_head": (0.25, 0.75), "a_foot": (0.5, 0.25)}.items():
        found.tracking.tracks.new(name=name, frame=1).markers[0].co = place
    return found


def test_a_box_surrounds_the_markers_whose_names_begin_so_and_rows_are_turned_over(clip):
    assert tracked_box(clip, "a_", 1, (64, 36)) == pytest.approx((16, 9, 32, 27))


def test_one_tracks_pattern_is_a_box(clip):
    marker = clip.tracking.tracks["left"].markers[0]
    marker.co = (0.5, 0.5)
    marker.pattern_corners = ((-0.1, -0.2), (0.1, -0.2), (0.1, 0.3), (-0.1, 0.3))
    found = tracked_box(clip, "left", 1, (100, 100))
    assert found == pytest.approx((40, 20, 60, 70), abs=1e-4)


def test_tracks_are_read_at_the_scenes_frame_of_the_clip(clip):
    clip.frame_start = 11
    for track in clip.tracking.tracks:
        track.markers.insert_frame(5, co=np.array(track.markers[0].co) + (0.25, 0.0))
    assert tracked_box(clip, "a_", 15, (64, 36)) == pytest.approx((32, 9, 48, 27))
    with pytest.raises(ShotError, match="'a_' is not tracked at frame 40"):
        tracked_box(clip, "a_", 40, (64, 36))


def test_unknown_single_and_disabled_tracks_are_said(clip):
    with pytest.raises(ShotError, match="no track 'b_'; it has left, a_head, a_foot"):
        tracked_box(clip, "b_", 1, (64, 36))
    with pytest.raises(ShotError, match="needs two or more"):
        tracked_box(clip, "a_h", 1, (64, 36))
    clip.tracking.tracks["left"].markers[0].mute = True
    with pytest.raises(ShotError, match="not tracked at frame 1"):
        tracked_box(clip, "left", 1, (64, 36))


def test_boxes_are_taken_from_the_tracks_that_are_named(settings, clip):
    with pytest.raises(RuntimeError, match="Choose a movie clip"):
        bpy.ops.playable.boxes_from_tracks()
    settings.framing.clip = clip
    with pytest.raises(RuntimeError, match="Name the tracks"):
        bpy.ops.playable.boxes_from_tracks()
    assert [each.name for each in settings.framing.tracked] == list(BOXES)
    settings.boxes["player_2"].box = BOXES["player_2"]
    settings.framing.tracked["player_1"].tracks = "a_"
    bpy.context.scene.frame_set(1)
    bpy.ops.playable.boxes_from_tracks()
    assert settings.typed_boxes() == {"player_1": (16, 9, 32, 27), "player_2": BOXES["player_2"]}


def test_the_framed_picture_tells_all_that_is_known_of_it(scene, settings):
    settings.boxes["player_1"].box = BOXES["player_1"]
    bpy.ops.playable.place_ground_points(pixel=(3, 4), place=(1, 2))
    seen = framed_picture(scene)
    assert (seen.size, seen.boxes) == ((WIDTH, HEIGHT), {"player_1": BOXES["player_1"]})
    assert seen.camera.width == WIDTH and seen.facts.name == "fake" and seen.trouble == ""
    assert [(each.name, each.pixel, each.place) for each in seen.points] == [
        ("Point 1", (3, 4), (1, 2))
    ]
    assert framed_picture(scene) is seen
    settings.boxes["player_1"].box = (0, 10, 20, 30)
    warned = framed_picture(scene)
    assert [each.kind for each in warned.warnings["player_1"]] == ["border"]


def test_an_encoded_picture_is_no_longer_framed_until_somebody_works_on_it(environment):
    assert framed_picture(environment) is None
    bpy.ops.playable.detect_boxes()
    assert set(framed_picture(environment).boxes) == set(BOXES)
    bpy.ops.playable.new_environment()
    assert framed_picture(environment) is None
    environment.playable_environment.boxes["player_1"].box = (9, 10, 20, 30)
    assert framed_picture(environment).boxes["player_1"] == (9, 10, 20, 30)


def test_asking_for_the_framed_picture_never_starts_a_worker(scene, settings, addon):
    addon.use_command(["/nowhere"])
    assert framed_picture(scene).facts.playable_names == tuple(BOXES)
    assert addon.worker_pid is None
    addon.use_command(FAKE)


def test_facts_of_another_version_count_as_none(settings):
    assert read_facts("{}") is None and read_facts("no json") is None and read_facts("") is None
    settings.model = "still"
    assert settings.framing.facts is None


def lacks(scene):
    return {each.step: each.text for each in all_missing(scene, [scene])}


def test_the_panel_says_step_by_step_what_is_missing(scene, picture):
    settings = scene.playable_environment
    framing = settings.framing
    settings.model = "fake"
    assert lacks(scene) == {
        1: "Choose a picture",
        3: "Draw, find or type the box of one playable object or more",
    }
    settings.image_path = "/nowhere.png"
    assert "is gone" in lacks(scene)[1]
    framing.picture_source = "IMAGE"
    assert lacks(scene)[1] == "Choose an Image"
    framing.picture_source = "STRIP"
    assert "playhead" in lacks(scene)[1]
    framing.picture_source, settings.image_path = "FILE", str(picture)
    framing.camera_mode = "MATCH"
    assert lacks(scene)[2] == "Place 4 or more points of the ground"
    for pixel in ((3, 4), (9, 4), (9, 20), (3, 20)):
        bpy.ops.playable.place_ground_points(pixel=pixel)
    assert lacks(scene)[2].startswith("Say where Point 2 lies on the ground")
    for number, point in enumerate(framing.points):
        point.place = (number, number * number)
    assert 2 not in lacks(scene)
    framing.camera_mode = "SCENE"
    scene.render.resolution_x = 200
    assert "another shape" in lacks(scene)[2]
    bpy.data.objects.remove(scene.camera)
    assert lacks(scene)[2] == "Choose a camera of the scene"
    settings.model = ""
    assert lacks(scene)[1] == "Choose a model file"


def test_the_button_is_greyed_with_the_reason_until_all_is_there(scene, settings):
    with pytest.raises(RuntimeError, match="Draw, find or type the box"):
        bpy.ops.playable.open_picture()
    settings.boxes["player_1"].box = (70, 10, 90, 30)
    with pytest.raises(RuntimeError, match="Draw the box of player_1 again"):
        bpy.ops.playable.open_picture()
    settings.boxes["player_1"].box = BOXES["player_1"]
    assert missing(scene, [scene]) is None
    bpy.ops.playable.open_picture()
    assert list(playable_objects(scene)) == ["player_1"]


def test_what_is_unusual_is_said_when_an_environment_is_made(settings, capfd):
    settings.boxes["player_1"].box = (0, 10, 12, 30)
    bpy.ops.playable.open_picture()
    assert "unusual: player_1: the box touches the left border" in capfd.readouterr().out


def test_a_new_environment_can_have_a_scene_of_its_own(environment, picture):
    old = environment.playable_environment
    before = old.state_text.as_string()
    old.framing.camera_mode = "SCENE"
    bpy.ops.playable.open_picture(new_scene=True)
    assert old.state_text.as_string() == before and len(bpy.data.scenes) == 2
    (made,) = set(bpy.data.scenes) - {environment}
    assert bpy.context.window.scene == made
    assert list(playable_objects(made)) == list(BOXES)
    assert made.camera is not None and made.camera != environment.camera
    assert made.playable_environment.root != old.root
    assert made.render.fps == environment.render.fps
    first = playable_objects(environment)["player_1"].location
    assert playable_objects(made)["player_1"].location == first


def test_the_model_is_chosen_by_name_or_as_a_file(scene):
    settings = scene.playable_environment
    framing = settings.framing
    assert framing.model_choice == "duel"
    framing.model_choice = "FILE"
    assert settings.model == "" and framing.model_choice == "FILE"
    settings.model = "//own.safetensors"
    framing.model_choice = "FILE"
    assert settings.model == "//own.safetensors"
    framing.model_choice = "duel"
    assert settings.model == "duel"


def test_what_was_framed_survives_saving_and_loading(scene, settings, tmp_path):
    bpy.ops.playable.place_ground_points(pixel=(3, 4), place=(1, 2))
    bpy.ops.playable.detect_boxes()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "film.blend"))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "film.blend"))
    seen = framed_picture(bpy.data.scenes[0])
    assert set(seen.boxes) == set(BOXES) and seen.facts.name == "fake"
    assert seen.points[0].place == (1, 2)
