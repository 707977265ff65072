"""Operators that render a range: blocking when executed, with progress and Esc in a window."""

import json
import time

import bpy
from bpy.app.translations import pgettext_tip as tip_
from bpy.props import BoolProperty

from pe_runtime.contract.errors import PlayableEnvironmentError, ShotError

from ..windows import redraw_sidebars
from ..worker.worker_operator import Result, end_modal, failed, show_progress, start_modal
from .job import RangeJob, claim_job, job_for
from .placing import show_new_pixels
from .plan import ForeignFilesError, foreign_files
from .running import Begin, Outcome, Progress, Running, run_job, shown_progress
from .target import check_target

TURN_SECONDS = 0.005
EVERYTHING = "Render frames too that are there already and would look the same"


class RangeOperator:
    """Runs a job of the scene that `source` names; `conclude` does what comes after it.

    A file that the job has not written is replaced only where `overwrite` says so. In a window the
    artist is asked, by an operator that runs this one again.
    """

    everything: BoolProperty(
        name="Render Everything Again",
        description=EVERYTHING,
        default=False,
        options={"SKIP_SAVE"},
    )
    overwrite: BoolProperty(
        name="Overwrite",
        description="Replace files too that were not rendered here or were changed since",
        default=False,
        options={"SKIP_SAVE"},
    )

    @classmethod
    def description(
        cls, _context: bpy.types.Context, properties: bpy.types.OperatorProperties
    ) -> str:
        """The tooltip of a button; empty for the class's own."""
        return tip_(EVERYTHING) if properties.everything else ""

    def source(self, context: bpy.types.Context) -> bpy.types.Scene:
        """The scene that is rendered.

        Raises:
            ShotError: There is none.
        """
        return context.scene

    def frames_folder(self, context: bpy.types.Context) -> str:
        """Where the files go."""
        return self.source(context).playable_environment.frames_folder

    def frames(self, _scene: bpy.types.Scene) -> tuple[int, int] | None:
        """First and last frame; None for the scene's range."""
        return None

    def conclude(self, context: bpy.types.Context, job: RangeJob, outcome: Outcome) -> None:
        """Take the finished frames further; called on the main thread."""

    def execute(self, context: bpy.types.Context) -> Result:
        try:
            running = self._start(context, _render_now)
            return self._finish(context, _drained(running))
        except (PlayableEnvironmentError, RuntimeError) as error:
            return self._fail(error)

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> Result:
        try:
            self._running = self._start(context, _render_behind)
            if not self.overwrite and (foreign := foreign_files(self._job)):
                raise ForeignFilesError(foreign)
        except ForeignFilesError as error:
            return self._ask(error)
        except PlayableEnvironmentError as error:
            return failed(self, error)
        self._progress = Progress("Starting")
        start_modal(self, context)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        if event.type == "ESC" and not self._progress.renders:
            self._end(context)
            self.report({"WARNING"}, f"{self.bl_label} was cancelled")
            return {"CANCELLED"}
        if event.type != "TIMER":
            # While Blender renders, its own job listens for Esc.
            return {"PASS_THROUGH"}
        try:
            self._progress = next(self._running)
            self._show(context)
            return {"RUNNING_MODAL"}
        except StopIteration as end:
            self._end(context)
            return self._conclude_safely(context, end.value)
        except ForeignFilesError as error:
            self._end(context)
            return self._ask(error)
        except (PlayableEnvironmentError, RuntimeError) as error:
            self._end(context)
            return self._fail(error)
        except BaseException:
            self._end(context)
            raise

    def cancel(self, context: bpy.types.Context) -> None:
        """Blender takes the operator away: a file is opened, or Blender quits."""
        self._end(context)

    def _start(self, context: bpy.types.Context, begin: Begin) -> Running:
        scene = self.source(context)
        if scene.library is not None:
            raise ShotError(f"scene {scene.name!r} is linked from another file; render it there")
        check_target(scene)
        claim_job(scene)
        self._job = job_for(scene, self.frames_folder(context), self.frames(scene))
        everything = self.everything or not scene.playable_environment.strips.only_changed
        return run_job(self._job, begin, everything, self.overwrite)

    def _conclude_safely(self, context: bpy.types.Context, outcome: Outcome) -> Result:
        try:
            return self._finish(context, outcome)
        except PlayableEnvironmentError as error:
            return failed(self, error)

    def _finish(self, context: bpy.types.Context, outcome: Outcome) -> Result:
        show_new_pixels(self._job.folder)
        for warning in outcome.warnings:
            self.report({"WARNING"}, warning)
        if outcome.stopped:
            self.report({"WARNING"}, outcome.in_words())
            return {"CANCELLED"}
        self.conclude(context, self._job, outcome)
        self.report({"INFO"}, outcome.in_words())
        return {"FINISHED"}

    def _fail(self, error: Exception) -> Result:
        if hasattr(self, "_job"):
            show_new_pixels(self._job.folder)
        return failed(self, error)

    def _ask(self, error: ForeignFilesError) -> Result:
        """Have the artist say whether files may be lost; the answer runs the operator again."""
        given = self.as_keywords()
        given = {name: given[name] for name in given if self.properties.is_property_set(name)}
        bpy.ops.playable.overwrite_frames(
            "INVOKE_DEFAULT",
            job=self.bl_idname.partition("_OT_")[2],
            options=json.dumps(given),
            count=error.count,
        )
        return {"CANCELLED"}

    def _show(self, context: bpy.types.Context) -> None:
        shown_progress[self._job.id] = self._progress
        show_progress(context, self._progress.text, self._progress.share)
        redraw_sidebars("VIEW_3D", "SEQUENCE_EDITOR")

    def _end(self, context: bpy.types.Context) -> None:
        self._running.close()
        shown_progress.pop(self._job.id, None)
        end_modal(self, context)
        redraw_sidebars("VIEW_3D", "SEQUENCE_EDITOR")


def _drained(running: Running) -> Outcome:
    try:
        while True:
            next(running)
            time.sleep(TURN_SECONDS)
    except StopIteration as end:
        return end.value
    finally:
        running.close()


def _render_now(scene_name: str) -> bool:
    bpy.ops.render.render(animation=True, scene=scene_name)
    return False


def _render_behind(scene_name: str) -> bool:
    if bpy.ops.render.render("INVOKE_DEFAULT", animation=True, scene=scene_name) == {"CANCELLED"}:
        raise ShotError("Blender did not start rendering; wait until its other jobs are done")
    return True
