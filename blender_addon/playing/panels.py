"""What the playable objects do, and where it leads them."""

import bpy
from bpy.app.translations import pgettext_iface as iface_

from pe_runtime.contract.errors import ShotError

from ..bake import bake_of
from ..panel import PlayablePanel, characters_beside_icon, wrapped_label
from ..scene_bridge import action_names
from ..settings import action_items
from . import keymap
from .action_keys import keyed_frames
from .claims import free_names, left_out, other_claims
from .directions import direction_icons
from .live_paths import UPDATING
from .stepping import action_warnings
from .watching import live

NUMBER_KEYS = 9


class PLAYABLE_PT_object(PlayablePanel, bpy.types.Panel):
    """What the active playable object does."""

    bl_label = "Playable Object"
    bl_idname = "PLAYABLE_PT_object"
    bl_order = 1

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.object is not None and context.object.type == "EMPTY"

    def draw(self, context: bpy.types.Context) -> None:
        target, layout = context.object, self.layout
        layout.use_property_split = True
        layout.prop(target.playable, "is_playable")
        if not target.playable.is_playable:
            return
        row = layout.row(align=True)
        row.prop(target.playable, "object_name")
        row.operator("playable.next_object", text="", icon="FORWARD")
        _draw_claims(layout, context.scene, target)
        if not action_names(target):
            layout.label(text="The model has no actions for it", icon="INFO")
            return
        _draw_actions(layout, target)
        _draw_keys(layout, target, context.scene.frame_current)


class PLAYABLE_PT_paths(PlayablePanel, bpy.types.Panel):
    """Predicted paths."""

    bl_label = "Paths"
    bl_idname = "PLAYABLE_PT_paths"
    bl_order = 2

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        # Before there is an environment, the three steps to it are all there is to see.
        return context.scene.playable_environment.root is not None

    def draw(self, context: bpy.types.Context) -> None:
        scene, layout = context.scene, self.layout
        row = layout.row(align=True)
        row.prop(scene, "frame_start", text="Start")
        row.prop(scene, "frame_end", text="End")
        layout.operator("playable.bake_paths", icon="CURVE_PATH")
        layout.operator_menu_enum("playable.actions_from_clip", "source", icon="FILE_MOVIE")
        layout.prop(scene.playable_environment.playing, "update_paths")
        _draw_bake(layout, scene)
        width = characters_beside_icon(context)
        if note := live.note(scene):
            wrapped_label(layout, note, "INFO" if note == UPDATING else "ERROR", width)
        for name in left_out(scene):
            row = layout.row(align=True)
            said = iface_("{name} has no Empty and rests").format(name=name)
            row.label(text=said, icon="INFO", translate=False)
            row.operator("playable.bring_back").object_name = name
        for text in action_warnings(scene):
            wrapped_label(layout, text, "ERROR", width)


def _draw_claims(
    layout: bpy.types.UILayout, scene: bpy.types.Scene, target: bpy.types.Object
) -> None:
    others = other_claims(scene, target)
    if not others:
        return
    column = layout.column(align=True)
    column.alert = True
    said = iface_("{other} stands for {name} too")
    said = said.format(other=others[0], name=target.playable.object_name)
    wrapped_label(column, said, "ERROR")
    if free_names(scene, target):
        column.operator_menu_enum("playable.stand_for", "object_name")
    column.operator("playable.make_not_playable")


def _draw_actions(layout: bpy.types.UILayout, target: bpy.types.Object) -> None:
    playable, names = target.playable, action_names(target)
    # Animatable, so that a pointer over it and the key I insert what is held.
    layout.prop(playable, "action")
    icons = direction_icons(playable.action_movements, len(names))
    grid = layout.grid_flow(row_major=True, columns=2, even_columns=True, align=True)
    for number, (identifier, label, *_) in enumerate(action_items(playable.action_names)):
        text = f"{number + 1}  {label}" if number < NUMBER_KEYS else label
        held = playable.action == identifier
        button = grid.operator("playable.do_action", text=text, icon=icons[number], depress=held)
        button.action = number


def _draw_keys(layout: bpy.types.UILayout, target: bpy.types.Object, frame: int) -> None:
    row = layout.row(align=True)
    back = row.operator("playable.jump_to_action_key", text="", icon="PREV_KEYFRAME")
    back.forward = False
    frames = keyed_frames(target)
    if frame in frames:
        row.operator("playable.delete_action_key", text="Delete Key", icon="KEY_DEHLT")
    else:
        row.label(text="No key at this frame" if frames else "No action keys yet")
    row.operator("playable.jump_to_action_key", text="", icon="NEXT_KEYFRAME").forward = True


def _draw_bake(layout: bpy.types.UILayout, scene: bpy.types.Scene) -> None:
    settings = scene.playable_environment
    if settings.bake_text is None:
        layout.label(text="Nothing is baked yet", icon="INFO")
        return
    try:
        shot = bake_of(settings).shot
        said = iface_("Baked: frames {first} to {last}")
        said = said.format(first=shot.frame_start, last=shot.frame_end)
        layout.label(text=said, translate=False)
    except ShotError as reason:
        layout.label(text=str(reason).partition(";")[0].capitalize(), icon="INFO")


CLASSES = (PLAYABLE_PT_object, PLAYABLE_PT_paths)


def register() -> None:
    """Register the panels, and the keys of the keyboard."""
    for each in CLASSES:
        bpy.utils.register_class(each)
    keymap.add_keys(bpy.context.window_manager)


def unregister() -> None:
    """Undo `register`."""
    keymap.remove_keys(bpy.context.window_manager)
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
