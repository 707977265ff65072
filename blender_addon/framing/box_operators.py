"""The boxes of the playable objects: detected, or taken from tracking markers."""

import bpy
from bpy.props import StringProperty

from pe_runtime.contract.errors import PlayableEnvironmentError, ShotError

from ..polls import allowed
from ..worker import questions
from ..worker.replies import DetectedBoxes
from ..worker.session import session
from ..worker.worker_operator import Task, WorkerOperator, failed, model_path
from .box_limits import Box, all_inside
from .picture_source import find_picture
from .readiness import edits_of
from .tracked_boxes import tracked_box


class PLAYABLE_OT_detect_boxes(WorkerOperator, bpy.types.Operator):
    """Find the playable objects in the picture and draw their boxes"""

    bl_idname = "playable.detect_boxes"
    bl_label = "Detect"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        facts = context.scene.playable_environment.framing.facts
        # Before the model is loaded nobody knows: pressing it finds out.
        return allowed(
            cls,
            facts is None or facts.detects,
            "The runtime has no detector installed; draw the boxes instead",
        )

    def task(self, context: bpy.types.Context) -> Task:
        name, scene = context.scene.name, context.scene
        model = model_path(scene.playable_environment.model)
        found = find_picture(scene, edits_of(context))

        def work(should_stop: object, on_progress: object) -> tuple:
            on_progress("loading the model", 0, 2)
            facts = session.facts(model, should_stop)
            on_progress("looking for players", 1, 2)
            names = facts.playable_names
            return facts, questions.detect(session, model, found.pixels, names, should_stop)

        def finish(answer: tuple) -> str:
            facts, detected = answer
            settings = bpy.data.scenes[name].playable_environment
            settings.note_facts(facts)
            boxes, notes = all_inside(detected.boxes, found.size)
            # Whoever was not found keeps the box that was drawn.
            settings.set_boxes(facts.playable_names, settings.typed_boxes() | boxes)
            settings.framing.is_open = True
            return "; ".join((_what_was_found(facts.playable_names, detected), *notes))

        return Task(work, finish)


class PLAYABLE_OT_boxes_from_tracks(bpy.types.Operator):
    """Take the boxes of the playable objects from the clip's tracking markers at this frame"""

    bl_idname = "playable.boxes_from_tracks"
    bl_label = "Boxes from Tracks"
    bl_options = {"UNDO"}

    object: StringProperty(
        name="Object", description="Empty: every object that has tracks", options={"SKIP_SAVE"}
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        framing = context.scene.playable_environment.framing
        if not allowed(cls, framing.clip is not None, "Choose a movie clip with tracking markers"):
            return False
        named = any(each.tracks for each in framing.tracked)
        return allowed(cls, named, "Name the tracks of one object or more")

    def execute(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        settings = scene.playable_environment
        try:
            size = find_picture(scene, edits_of(context)).size
            boxes, notes = all_inside(self._tracked(scene, size), size)
        except PlayableEnvironmentError as error:
            return failed(self, error)
        settings.list_boxes([each.name for each in settings.framing.tracked])
        for name, box in boxes.items():
            settings.boxes[name].box = box
        settings.framing.is_open = True
        self.report({"INFO"}, "; ".join((f"{len(boxes)} boxes from tracks", *notes)))
        return {"FINISHED"}

    def _tracked(self, scene: bpy.types.Scene, size: tuple[int, int]) -> dict[str, Box]:
        framing = scene.playable_environment.framing
        wanted = [each for each in framing.tracked if each.tracks]
        wanted = [each for each in wanted if self.object in ("", each.name)]
        if not wanted:
            raise ShotError(f"no tracks are named for {self.object!r}")
        return {
            each.name: tracked_box(framing.clip, each.tracks, scene.frame_current, size)
            for each in wanted
        }


def _what_was_found(names: tuple[str, ...], detected: DetectedBoxes) -> str:
    found = [f"{n} ({detected.scores[n]:.0%} sure)" for n in names if n in detected.boxes]
    lost = [name for name in names if name not in detected.boxes]
    said = f"found {', '.join(found)}" if found else "found nobody"
    return f"{said}; not found: {', '.join(lost)}, draw their boxes" if lost else said


CLASSES = (PLAYABLE_OT_detect_boxes, PLAYABLE_OT_boxes_from_tracks)

register, unregister = bpy.utils.register_classes_factory(CLASSES)
