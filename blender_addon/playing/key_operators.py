"""Keying what playable objects do: by buttons, by number keys, and going from key to key."""

import bpy
from bpy.app.translations import pgettext_tip as tip_
from bpy.props import BoolProperty, EnumProperty, IntProperty

from pe_runtime.contract.errors import PlayableEnvironmentError

from .. import playables
from ..polls import allowed, in_object_mode, not_rendering, playable_chosen
from ..scene_bridge import action_names
from ..settings import action_items
from ..worker.worker_operator import Result, failed
from .action_keys import delete_key_at, keyed_frames, neighbour, next_playable, players_at_hand


class PLAYABLE_OT_insert_action_key(bpy.types.Operator):
    """Let the active playable object do an action from this frame to its next key"""

    bl_idname = "playable.insert_action_key"
    bl_label = "Insert Action Key"
    bl_options = {"REGISTER", "UNDO"}

    action: EnumProperty(
        name="Action",
        description="What the object does from this frame on",
        translation_context="Playable",
        items=lambda _self, context: action_items(_names_in(context)),
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not playable_chosen(cls, context.object):
            return False
        return allowed(cls, bool(action_names(context.object)), "The model has no actions for it")

    def execute(self, context: bpy.types.Context) -> Result:
        action = int(self.action.removeprefix("A"))
        try:
            playables.key_action(context.object, context.scene.frame_current, action)
        except PlayableEnvironmentError as error:
            return failed(self, error)
        return {"FINISHED"}


class PLAYABLE_OT_do_action(bpy.types.Operator):
    """Let the selected playable objects do an action from this frame to their next keys"""

    bl_idname = "playable.do_action"
    bl_label = "Do Action"
    bl_options = {"REGISTER", "UNDO"}

    action: IntProperty(name="Action", description="Number of the action, from 0", min=0)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _has_players(cls, context)

    @classmethod
    def description(cls, context: bpy.types.Context, properties: object) -> str:
        items = action_items(_names_in(context))
        if properties.action >= len(items):
            return tip_("The model has no such action")
        label = items[properties.action][1]
        return tip_("{action}: from this frame to the next key").format(action=label)

    def execute(self, context: bpy.types.Context) -> Result:
        able = [each for each in _players(context) if self.action < len(action_names(each))]
        if not able:
            counts = {len(action_names(each)) for each in _players(context)}
            self.report({"WARNING"}, f"There is no action {self.action + 1} of {max(counts)}")
            return {"CANCELLED"}
        try:
            for each in able:
                playables.key_action(each, context.scene.frame_current, self.action)
        except PlayableEnvironmentError as error:
            return failed(self, error)
        return {"FINISHED"}


class PLAYABLE_OT_delete_action_key(bpy.types.Operator):
    """Delete the action keys of the selected playable objects at this frame"""

    bl_idname = "playable.delete_action_key"
    bl_label = "Delete Action Key"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not _has_players(cls, context):
            return False
        frame = context.scene.frame_current
        keyed = any(frame in keyed_frames(each) for each in _players(context))
        return allowed(cls, keyed, "There is no action key at this frame")

    def execute(self, context: bpy.types.Context) -> Result:
        try:
            for each in _players(context):
                delete_key_at(each, context.scene.frame_current)
        except PlayableEnvironmentError as error:
            return failed(self, error)
        return {"FINISHED"}


class PLAYABLE_OT_jump_to_action_key(bpy.types.Operator):
    """Go to the next or the previous action key of the selected playable objects"""

    bl_idname = "playable.jump_to_action_key"
    bl_label = "Jump to Action Key"
    bl_options = {"UNDO_GROUPED"}
    bl_undo_group = "Frame Change"

    forward: BoolProperty(name="Next", description="To the next key, not the previous one")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not _has_players(cls, context):
            return False
        return not_rendering(cls)

    @classmethod
    def description(cls, _context: bpy.types.Context, properties: object) -> str:
        return tip_("Go to the next key" if properties.forward else "Go to the previous key")

    def execute(self, context: bpy.types.Context) -> Result:
        scene = context.scene
        frames = {frame for each in _players(context) for frame in keyed_frames(each)}
        frame = neighbour(frames, scene.frame_current, self.forward)
        if frame is None:
            self.report({"INFO"}, f"No {'later' if self.forward else 'earlier'} action key")
            return {"CANCELLED"}
        scene.frame_set(frame)
        return {"FINISHED"}


class PLAYABLE_OT_next_object(bpy.types.Operator):
    """Select the next playable object, so that the number keys play it"""

    bl_idname = "playable.next_object"
    bl_label = "Next Playable Object"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        # Nothing else may be active: Tab has to edit meshes as ever.
        return playable_chosen(cls, context.object)

    def execute(self, context: bpy.types.Context) -> Result:
        following = next_playable(context.view_layer, context.object)
        if following is None:
            self.report({"INFO"}, "No playable Empty is shown")
            return {"CANCELLED"}
        for each in context.view_layer.objects.selected:
            each.select_set(False)
        following.select_set(True)
        context.view_layer.objects.active = following
        return {"FINISHED"}


def _players(context: bpy.types.Context) -> list[bpy.types.Object]:
    return players_at_hand(context.view_layer, context.object)


def _has_players(operator: type, context: bpy.types.Context) -> bool:
    if not in_object_mode(operator, context):
        return False
    if not playable_chosen(operator, context.object):
        return False
    acting = any(action_names(each) for each in _players(context))
    return allowed(operator, acting, "The model has no actions for it")


def _names_in(context: bpy.types.Context | None) -> str:
    chosen = context.object if context is not None else None
    return chosen.playable.action_names if chosen is not None else ""


CLASSES = (
    PLAYABLE_OT_insert_action_key,
    PLAYABLE_OT_do_action,
    PLAYABLE_OT_delete_action_key,
    PLAYABLE_OT_jump_to_action_key,
    PLAYABLE_OT_next_object,
)

register, unregister = bpy.utils.register_classes_factory(CLASSES)
