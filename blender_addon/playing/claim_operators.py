"""Putting right who stands for whom, after Empties were duplicated or deleted."""

import json

import bpy
from bpy.app.translations import pgettext_tip as tip_
from bpy.props import EnumProperty, StringProperty

from pe_runtime.contract.errors import ShotError
from pe_runtime.contract.model_facts import ModelFacts

from .. import playables
from ..framing.settings import read_facts
from ..polls import allowed, playable_chosen
from ..worker.session import session
from ..worker.worker_operator import Result, Task, WorkerOperator, model_path
from .claims import free_names, left_out, other_claims

_offered: list[tuple[str, str, str]] = []


def _free_items(_self: object, context: bpy.types.Context | None) -> list[tuple[str, str, str]]:
    # Kept in the module: Blender does not keep the strings of dynamic items alive.
    target = context.object if context is not None else None
    names = free_names(context.scene, target) if target is not None else []
    said = tip_("Let it stand for {name}")
    _offered[:] = [(name, name, said.format(name=name)) for name in names]
    return _offered


class PLAYABLE_OT_stand_for(bpy.types.Operator):
    """Let this Empty stand for another playable object, for which nobody stands yet"""

    bl_idname = "playable.stand_for"
    bl_label = "Let It Stand for"
    bl_options = {"REGISTER", "UNDO"}

    object_name: EnumProperty(name="Object", description="The playable object", items=_free_items)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not playable_chosen(cls, context.object):
            return False
        free = free_names(context.scene, context.object)
        return allowed(cls, bool(free), "Every playable object of the picture has its Empty")

    def execute(self, context: bpy.types.Context) -> Result:
        target, name = context.object, self.object_name
        facts = read_facts(context.scene.playable_environment.framing.facts_text)
        target.playable.object_name = name
        if facts is not None and name in facts.action_names:
            playables.teach_actions(target, name, facts)
        return {"FINISHED"}


class PLAYABLE_OT_make_not_playable(bpy.types.Operator):
    """Let this Empty stand for nobody; it keeps its keys"""

    bl_idname = "playable.make_not_playable"
    bl_label = "Make Not Playable"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return playable_chosen(cls, context.object)

    def execute(self, context: bpy.types.Context) -> Result:
        others = other_claims(context.scene, context.object)
        context.object.playable.is_playable = False
        if others:
            name = context.object.playable.object_name
            self.report({"INFO"}, f"{others[0]} alone stands for {name} now")
        return {"FINISHED"}


class PLAYABLE_OT_bring_back(WorkerOperator, bpy.types.Operator):
    """Make the Empty of a playable object again, where the picture shows the object"""

    bl_idname = "playable.bring_back"
    bl_label = "Bring Back"
    bl_options = {"UNDO"}

    object_name: StringProperty(name="Object", description="The playable object")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        has_state = context.scene.playable_environment.state_text is not None
        return allowed(cls, has_state, "Make a New Playable Environment first")

    def task(self, context: bpy.types.Context) -> Task:
        scene, name = context.scene, self.object_name
        if name not in left_out(scene):
            raise ShotError(f"{name!r} is no object of the picture that lacks an Empty")
        where, model = scene.name, model_path(scene.playable_environment.model)

        def finish(facts: ModelFacts) -> str:
            stage = bpy.data.scenes[where]
            state = json.loads(stage.playable_environment.state_text.as_string())["state"]
            playables.place_empty(stage, name, facts, state["objects"][name])
            return f"{name} has an Empty again"

        return Task(lambda should_stop, _: session.facts(model, should_stop), finish)


CLASSES = (PLAYABLE_OT_stand_for, PLAYABLE_OT_make_not_playable, PLAYABLE_OT_bring_back)

register, unregister = bpy.utils.register_classes_factory(CLASSES)
