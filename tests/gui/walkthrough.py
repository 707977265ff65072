"""The five minutes of the README in a real Blender window, with a picture of every step.

Run by run.sh, which says what it needs. Where a step does not lead where it should, Blender ends
with 1 and the last picture shows why.
"""

import json
import os
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

import bpy
from mathutils import Euler, Vector

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

import clip  # noqa: E402 beside this file, which Blender does not look for
from undoing import undo_and_redo  # noqa: E402
from window import PAUSE, Window, check, say, tell  # noqa: E402

OUT = Path(os.environ["GUI_PICTURES"])
ADDON = "bl_ext.user_default.playable_environments"
DIGITS = ("ONE", "TWO", "THREE", "FOUR", "FIVE", "SIX", "SEVEN", "EIGHT", "NINE")
LOOK = 3.0
"""Seconds after which what was asked of the worker is shown."""
LAST_FRAME, FPS = 36, 12
PLACES = ((-2.5, -1.0), (2.5, -1.0), (2.0, 2.5), (-2.5, 2.5), (0.0, 0.5))
"""Of the ground, metres."""
ACTIONS = {
    "player_1": ((1, "right"), (13, "idle"), (22, "forward")),
    "player_2": ((1, "forward"), (10, "left"), (25, "idle")),
}


def story(window: Window) -> Iterator:
    """The steps, in the order of the README."""
    yield from enable(window)
    yield from preferences(window)
    yield from frame_a_picture(window)
    yield from match_a_camera(window)
    yield from warn(window)
    yield from encode(window)
    yield from play(window)
    yield from film(window)
    yield from preview(window)
    yield from render_a_still(window)
    yield from render_to_sequencer(window)
    yield from go_back(window)
    yield from undo_and_redo(window, choose, players)


def enable(window: Window) -> Iterator:
    """Install the extension and begin an empty file."""
    archive = next(OUT.glob("playable_environments-*.zip"))
    bpy.ops.extensions.package_install_files(
        filepath=str(archive), repo="user_default", enable_on_install=True
    )
    check(hasattr(bpy.types.Scene, "playable_environment"), "the extension did not install")
    kept = bpy.context.preferences.addons[ADDON].preferences
    kept.runtime_python = os.environ["GUI_PYTHON"]
    bpy.ops.object.select_all(action="SELECT")
    bpy.ops.object.delete()
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end, scene.render.fps = 1, LAST_FRAME, FPS
    bpy.ops.wm.save_as_mainfile(filepath=str(OUT / "walkthrough.blend"))
    yield PAUSE
    yield from window.show_tab("Playable")
    window.picture("empty_file")


def preferences(window: Window) -> Iterator:
    """What the preferences say of the runtime."""
    shown = bpy.context.preferences
    bpy.ops.screen.userpref_show("INVOKE_DEFAULT")
    shown.active_section = "ADDONS"
    bpy.context.window_manager.addon_search = "Playable"
    bpy.ops.preferences.addon_expand(module=ADDON)
    yield PAUSE
    # Looking at the page has begun a check of the runtime.
    found = addon_module("installing.installation").installation
    yield lambda: not found.busy
    yield PAUSE
    window.picture("preferences")
    window.close_others()
    yield PAUSE


def frame_a_picture(window: Window) -> Iterator:
    """Picture, usual camera and boxes; the overlay shows them on the picture."""
    settings = bpy.context.scene.playable_environment
    shutil.copy(clip.PICTURE, OUT / "picture.png")
    settings.image_path = "//picture.png"
    yield from press(window, "load_model")
    yield lambda: len(settings.boxes) == len(clip.BOXES)
    yield from press(window, "show_picture")
    yield lambda: bpy.context.scene.camera is not None
    settings.set_boxes(clip.BOXES, clip.BOXES)
    look_through_camera(window)
    yield PAUSE
    window.picture("boxes_on_the_picture")


def match_a_camera(window: Window) -> Iterator:
    """Ground points, one of them placed badly: the overlay shows which."""
    framing = bpy.context.scene.playable_environment.framing
    framing.camera_mode = "MATCH"
    for index, place in enumerate(PLACES):
        point, (u, v) = framing.add_point(), clip.pixel_of(*place)
        point.place, point.pixel, point.is_placed = place, (u + 8.0 * (index == 1), v), True
    yield from press(window, "match_camera")
    yield lambda: framing.residual >= 0.0
    check(framing.residual < 10.0, f"the camera misses by {framing.residual} pixels")
    yield PAUSE
    window.picture("camera_from_ground_points")
    framing.camera_mode = "USUAL"
    yield from press(window, "show_picture")


def warn(window: Window) -> Iterator:
    """Boxes that the model cannot know, or nobody can: amber and red, with the reason."""
    settings = bpy.context.scene.playable_environment
    left, top, right, bottom = clip.BOXES["player_2"]
    settings.boxes["player_2"].box = left, top, right, bottom - 30.0
    yield PAUSE
    window.picture("a_box_with_a_warning")
    settings.set_boxes(clip.BOXES, clip.BOXES)
    yield PAUSE


def encode(window: Window) -> Iterator:
    """New Playable Environment."""
    settings = bpy.context.scene.playable_environment
    yield from press(window, "open_picture")
    yield lambda: settings.root is not None
    yield LOOK
    yield paths_are_live
    yield PAUSE
    check(len(players()) == len(clip.BOXES), f"the players are {list(players())}")
    window.picture("new_environment")


def play(window: Window) -> Iterator:
    """Actions are keyed, by number keys and by buttons; paths and ghosts show where they lead."""
    for name, keys in ACTIONS.items():
        choose(players()[name])
        for frame, action in keys:
            bpy.context.scene.frame_set(frame)
            number = action_number(action)
            if name == "player_1":
                window.key(DIGITS[number], window.middle_of("VIEW_3D"))
            else:
                yield from press(window, "do_action", action=number)
            yield PAUSE
            done = int(bpy.context.object.playable.action.removeprefix("A"))
            check(done == number, f"{name} does {done}, not {number}, at frame {frame}")
    bpy.context.scene.frame_set(13)
    yield paths_are_live
    yield PAUSE
    window.picture("paths_and_ghosts")
    with window.area_of("VIEW_3D") as area:
        view = area.spaces.active.region_3d
        view.view_perspective = "PERSP"
        view.view_location, view.view_distance = Vector((0.0, 0.5, 0.5)), 9.0
        view.view_rotation = Euler((1.0, 0.0, 0.55)).to_quaternion()
    yield PAUSE
    window.picture("paths_from_above")


def film(window: Window) -> Iterator:
    """The camera gets a move of its own."""
    camera = bpy.context.scene.camera
    choose(camera)
    away = camera.matrix_world.to_3x3() @ Vector((0.9, 0.0, -0.9))
    camera.keyframe_insert("location", frame=1)
    camera.location += away
    camera.keyframe_insert("location", frame=LAST_FRAME)
    bpy.context.scene.frame_set(24)
    look_through_camera(window)
    yield LOOK
    yield paths_are_live
    yield PAUSE
    window.picture("camera_move")


def preview(window: Window) -> Iterator:
    """Rendered shading follows the timeline."""
    with window.area_of("VIEW_3D") as area:
        area.spaces.active.shading.type = "RENDERED"
    yield LOOK * 2
    window.picture("rendered_preview")
    with window.area_of("VIEW_3D") as area:
        area.spaces.active.overlay.show_overlays = False
    bpy.context.scene.frame_set(31)
    yield LOOK
    window.picture("preview_of_another_frame")
    bpy.context.scene.frame_set(24)
    with window.area_of("VIEW_3D") as area:
        area.spaces.active.overlay.show_overlays = True
    with window.area_of("VIEW_3D") as area:
        area.spaces.active.shading.type = "SOLID"
    yield PAUSE


def render_a_still(window: Window) -> Iterator:
    """F12."""
    bpy.context.preferences.view.render_display_type = "SCREEN"
    finished = []
    bpy.app.handlers.render_complete.append(lambda *_: finished.append(True))
    with window.area_of("VIEW_3D"):
        bpy.ops.render.render("INVOKE_DEFAULT")
    yield lambda: bool(finished)
    yield PAUSE
    with window.area_of("IMAGE_EDITOR"):
        bpy.ops.image.view_all(fit_view=True)
    yield PAUSE
    window.picture("f12")
    with window.area_of("IMAGE_EDITOR"):
        bpy.ops.screen.back_to_previous()
    bpy.context.preferences.view.render_display_type = "NONE"
    yield PAUSE


def render_to_sequencer(window: Window) -> Iterator:
    """One strip, in the scene that the Video Editing workspace shows."""
    settings = bpy.context.scene.playable_environment
    yield from press(window, "render_to_sequencer")
    yield lambda: settings.edit_scene is not None and bool(strips(settings.edit_scene))
    yield LOOK
    with window.area_of("VIEW_3D", region="UI"):
        bpy.ops.view2d.scroll_down(page=True)
    yield PAUSE
    window.picture("rendered_to_sequencer")
    template = Path(bpy.utils.system_resource("SCRIPTS"), "startup", "bl_app_templates_system")
    bpy.ops.workspace.append_activate(
        idname="Video Editing", filepath=str(template / "Video_Editing" / "startup.blend")
    )
    yield PAUSE
    edit = settings.edit_scene
    bpy.context.window.scene = edit
    if hasattr(bpy.context.workspace, "sequencer_scene"):
        bpy.context.workspace.sequencer_scene = edit
    edit.frame_set(24)
    edit.sequence_editor.active_strip = strips(edit)[0]
    yield PAUSE
    yield from window.show_tab("Strip", "SEQUENCE_EDITOR")
    with window.area_of("SEQUENCE_EDITOR"):
        bpy.ops.sequencer.view_all()
    yield LOOK
    window.picture("video_editing")
    check(len(strips(edit)) == 1, f"there are {len(strips(edit))} strips")
    check(len(strips(edit)[0].elements) == LAST_FRAME, "the strip has another length")


def go_back(_window: Window) -> Iterator:
    """From the cut to the scene and its viewport."""
    bpy.context.window.workspace = bpy.data.workspaces["Layout"]
    yield PAUSE
    bpy.context.window.scene = next(
        each for each in bpy.data.scenes if each.playable_environment.root is not None
    )
    yield PAUSE


def addon_module(name: str) -> object:
    """A module of the installed extension."""
    return sys.modules[f"{ADDON}.{name}"]


def press(window: Window, name: str, **options: object) -> Iterator:
    """Press a button of the add-on, as the mouse does in the 3D viewport."""
    operator = getattr(bpy.ops.playable, name)
    with window.area_of("VIEW_3D"):
        check(operator.poll(), f"the button {name} is greyed")
        result = operator("INVOKE_DEFAULT", **options)
    check(not {"CANCELLED"} & result, f"{name} was cancelled")
    say(f"{name}: {', '.join(result).lower()}")
    yield PAUSE


def action_number(action: str) -> int:
    """The number of an action of the active player."""
    names = json.loads(bpy.context.object.playable.action_names)
    check(action in names, f"the model's actions are {names}")
    return names.index(action)


def paths_are_live() -> bool:
    """Whether the paths are those of the keys, and nothing is under way."""
    scene = bpy.context.scene
    note = addon_module("playing.watching").live.note(scene)
    check(note in ("", "Updating the paths"), f"the paths do not follow: {note}")
    return not note and scene.playable_environment.bake_text is not None


def players() -> dict[str, bpy.types.Object]:
    """The playable Empties by their names in the model."""
    playable = (each for each in bpy.context.scene.objects if each.playable.is_playable)
    return {each.playable.object_name: each for each in playable}


def choose(target: bpy.types.Object) -> None:
    """Select one object, as a click does."""
    for each in bpy.context.view_layer.objects:
        each.select_set(each == target)
    bpy.context.view_layer.objects.active = target


def look_through_camera(window: Window) -> None:
    """Numpad 0, and the frame as large as it goes."""
    with window.area_of("VIEW_3D") as area:
        area.spaces.active.region_3d.view_perspective = "CAMERA"
        bpy.ops.view3d.view_center_camera()


def strips(scene: bpy.types.Scene) -> list:
    """Everything in a scene's sequencer."""
    editor = scene.sequence_editor
    return [] if editor is None else list(getattr(editor, "strips", None) or editor.sequences)


if __name__ == "__main__":
    bpy.context.preferences.view.show_splash = False
    # The sidebar stands beside the picture, not over it.
    bpy.context.preferences.system.use_region_overlap = False
    shown = Window(OUT)
    tell(story(shown), shown, at_end=lambda: None)
