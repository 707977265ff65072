"""Collecting styles from other pictures and scenes."""

from collections.abc import Callable
from pathlib import Path

import bpy
from bpy.props import StringProperty

from pe_runtime.contract.errors import PlayableEnvironmentError, ShotError

from ..framing.box_limits import Box, all_inside
from ..framing.opening import boxes_from_json, check_names
from ..pictures import read_picture
from ..playables import Picture
from ..polls import allowed, has_environment
from ..scene_bridge import read_camera
from ..usual_camera import usual_camera
from ..worker import questions
from ..worker.session import session
from ..worker.worker_operator import Result, Task, WorkerOperator, failed, model_path
from .style_sources import Encoded, add_from_picture, add_from_scene, remove_style


class PLAYABLE_OT_add_style(WorkerOperator, bpy.types.Operator):
    """Encode another picture and collect how its object looks, for players to take on"""

    bl_idname = "playable.add_style"
    bl_label = "Add Style from Picture"
    bl_options = {"UNDO"}

    image: StringProperty(
        name="Picture", description="Empty: the scene's setting", options={"SKIP_SAVE"}
    )
    boxes: StringProperty(
        name="Boxes",
        description='Empty: the scene\'s setting. JSON: {"player_1": [left, top, right, bottom]}',
        options={"SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return has_environment(cls, context.scene)

    def task(self, context: bpy.types.Context) -> Task:
        scene, name = context.scene, context.scene.name
        settings = scene.playable_environment
        model, styles = model_path(settings.model), settings.styles
        chosen = self.image or styles.image_path
        if not chosen:
            raise ShotError("no picture is chosen for the style; choose an image file")
        path = str(Path(bpy.path.abspath(chosen)).resolve())
        pixels = read_picture(path)
        size = pixels.shape[1], pixels.shape[0]
        players, boxes = self._wanted(context)
        eye = None
        if styles.camera == "SCENE":
            context.view_layer.update()
            eye = read_camera(context.evaluated_depsgraph_get(), size)

        def work(should_stop: Callable, on_progress: Callable) -> Encoded:
            on_progress("loading the model", 0, 3)
            facts = session.facts(model, should_stop)
            check_names(players, facts.playable_names)
            on_progress("looking for players", 1, 3)
            found = boxes or _detected(model, pixels, players, facts.detects, should_stop)
            inside, _ = all_inside(found, size)
            on_progress("encoding", 2, 3)
            picture = Picture(path, eye or usual_camera(facts, *size), inside)
            state = session.encode(model, pixels, picture.camera, inside, should_stop)
            return Encoded(picture, state)

        def finish(found: Encoded) -> str:
            scene = bpy.data.scenes[name]
            names = add_from_picture(scene, scene.playable_environment.model, found)
            return f"Added {', '.join(names)}"

        return Task(work, finish)

    def _wanted(self, context: bpy.types.Context) -> tuple[tuple[str, ...], dict[str, Box]]:
        """Which objects lend their style, and their boxes where they are given."""
        if self.boxes:
            boxes = boxes_from_json(self.boxes)
            return tuple(boxes), boxes
        styles = context.scene.playable_environment.styles
        player, active = styles.player_name(), context.object
        if not player and active is not None and active.playable.is_playable:
            player = active.playable.object_name
        if not player:
            raise ShotError("choose the object that the other picture shows, or select an Empty")
        box = tuple(styles.box)
        return (player,), ({player: box} if any(box) else {})


class PLAYABLE_OT_add_scene_styles(bpy.types.Operator):
    """Collect how the players of another scene's environment look"""

    bl_idname = "playable.add_scene_styles"
    bl_label = "Add Styles from Scene"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not has_environment(cls, context.scene):
            return False
        other = context.scene.playable_environment.styles.scene
        return allowed(cls, other is not None, "Choose another scene first")

    def execute(self, context: bpy.types.Context) -> Result:
        styles = context.scene.playable_environment.styles
        try:
            names = add_from_scene(context.scene, styles.scene)
        except PlayableEnvironmentError as error:
            return failed(self, error)
        self.report({"INFO"}, f"Added {', '.join(names)}")
        return {"FINISHED"}


class PLAYABLE_OT_remove_style(bpy.types.Operator):
    """Remove the active style from the list; objects that wear it get their own look back"""

    bl_idname = "playable.remove_style"
    bl_label = "Remove Style"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        styles = context.scene.playable_environment.styles
        inside = 0 <= styles.active < len(styles.sources)
        return allowed(cls, inside, "There is no style to remove")

    def execute(self, context: bpy.types.Context) -> Result:
        styles = context.scene.playable_environment.styles
        try:
            keyed = remove_style(context.scene, styles.active)
        except PlayableEnvironmentError as error:
            return failed(self, error)
        if keyed:
            text = f"keys of {', '.join(keyed)} still ask for it; delete or change them"
            self.report({"WARNING"}, f"Removed, but {text}")
        return {"FINISHED"}


def _detected(
    model: str, pixels: object, players: tuple[str, ...], detects: bool, should_stop: Callable
) -> dict[str, Box]:
    if not detects:
        raise ShotError(
            "the runtime has no detector installed, so nobody can be looked for; type the box: "
            "left, top, right, bottom in pixels"
        )
    found = questions.detect(session, model, pixels, players, should_stop).boxes
    if not found:
        raise ShotError("nobody was found in the picture; type the box of the object")
    return dict(found)


CLASSES = (PLAYABLE_OT_add_style, PLAYABLE_OT_add_scene_styles, PLAYABLE_OT_remove_style)

register, unregister = bpy.utils.register_classes_factory(CLASSES)
