"""The scene whose sequencer shows a job's frames, and what stands in the way of that."""

import bpy

from pe_runtime.contract.errors import ShotError

from ..filming.pixels import colour_changes, use_exact_colours
from ..scene_bridge import frames_per_second
from .wish import file_size

_SHARED = ("fps", "fps_base", "pixel_aspect_x", "pixel_aspect_y")


def shadowed(scene: bpy.types.Scene) -> str:
    """Why Blender would render a scene's sequencer and never ask its engine; empty if it asks."""
    editor = scene.sequence_editor
    if not scene.render.use_sequencer or editor is None:
        return ""
    shown = [each for each in editor.strips if _shows(each, editor)]
    if not shown:
        return ""
    return f"The sequencer's strip {shown[0].name!r} would be rendered in place of the environment"


def target_of(scene: bpy.types.Scene) -> bpy.types.Scene:
    """The scene that gets a scene's strip: the chosen one, or its own Edit scene, made on need."""
    return scene.playable_environment.strips.target or _own_edit_scene(scene)


def check_target(scene: bpy.types.Scene) -> None:
    """Make sure that the strip will not come between a scene and its engine.

    Raises:
        ShotError: The chosen scene has an environment, and the artist has not agreed.
    """
    strips = scene.playable_environment.strips
    target = strips.target
    if target is None or target.playable_environment.root is None or strips.share_scene:
        return
    raise ShotError(
        f"a strip in scene {target.name!r} would be rendered in place of that scene's environment; "
        "choose a scene without one, or switch on Leave Sequencer Out"
    )


def target_warnings(scene: bpy.types.Scene, target: bpy.types.Scene) -> list[str]:
    """What will look different in the target's cut than in the scene."""
    said = []
    own, theirs = frames_per_second(scene), frames_per_second(target)
    if abs(own - theirs) > 1e-6 * own:
        said.append(
            f"{target.name!r} plays {theirs:g} frames a second, the environment {own:g}: the strip "
            f"plays {theirs / own:.3g} times as fast; give both scenes one frame rate"
        )
    # Dither leaves a sequencer's bytes as they are.
    if changes := [each for each in colour_changes(target) if "dither" not in each.lower()]:
        said.append(f"{target.name!r} changes the strip's colours: " + "; ".join(changes))
    return said


def leave_sequencer_out(target: bpy.types.Scene) -> None:
    """Keep the engine of a scene that has both an environment and a strip."""
    if target.playable_environment.root is not None:
        target.render.use_sequencer = False


def _own_edit_scene(scene: bpy.types.Scene) -> bpy.types.Scene:
    settings = scene.playable_environment
    edit = settings.edit_scene
    if edit is None:
        edit = settings.edit_scene = bpy.data.scenes.new(f"{scene.name} Edit")
        edit.frame_start, edit.frame_end = scene.frame_start, scene.frame_end
        use_exact_colours(edit)
    source, target = scene.render, edit.render
    # The size of the files at 100 %: the sequencer would shrink them once more by a percentage.
    target.resolution_x, target.resolution_y = file_size(scene)
    target.resolution_percentage = 100
    for name in _SHARED:
        setattr(target, name, getattr(source, name))
    return edit


def _shows(strip: bpy.types.Strip, editor: bpy.types.SequenceEditor) -> bool:
    return strip.type != "SOUND" and not strip.mute and not editor.channels[strip.channel].mute
