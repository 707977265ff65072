"""Exporting the scene's film for the command line and farms."""

from pathlib import Path

import bpy
from bpy.props import BoolProperty, StringProperty

from pe_runtime.contract.errors import PlayableEnvironmentError, ShotError

from ..bake import Output, bake_of
from ..playing.stand_in import moment_at, stand_in_for
from ..polls import has_bake, has_environment
from ..scene_bridge import frames_per_second, wanted_passes
from ..worker.worker_operator import Result, failed
from .exported_shot import film_of, write_film

SUFFIX = ".json"


class PLAYABLE_OT_export_shot(bpy.types.Operator):
    """Export the film for the command line"""

    bl_idname = "playable.export_shot"
    bl_label = "Export Shot"
    bl_description = (
        "Write the baked range with its camera and overrides as a shot file, and the encoded "
        "pictures beside it: pe render draws the same frames without Blender"
    )
    bl_options = {"REGISTER"}

    filepath: StringProperty(
        name="File", description="The shot file; encoded pictures go beside it", subtype="FILE_PATH"
    )
    filter_glob: StringProperty(default=f"*{SUFFIX}", options={"HIDDEN"})
    check_existing: BoolProperty(default=True, options={"HIDDEN"})

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return has_environment(cls, context.scene) and has_bake(cls, context.scene)

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> Result:
        if not self.filepath:
            self.filepath = f"{Path(bpy.data.filepath).stem or context.scene.name} shot{SUFFIX}"
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: bpy.types.Context) -> Result:
        try:
            path = _target(self.filepath)
            film = _film(context)
            files = write_film(film, path)
        except PlayableEnvironmentError as error:
            return failed(self, error)
        own = Path(film.model).is_absolute()
        also = f"; have the model {film.model} at the same place where it is drawn" if own else ""
        self.report(
            {"INFO"},
            f"Exported frames {film.frame_start} to {film.frame_end} and {len(files) - 1} encoded "
            f"pictures{also}",
        )
        return {"FINISHED"}


def _target(chosen: str) -> Path:
    if not chosen:
        raise ShotError("no file is chosen for the shot; give its path")
    path = Path(bpy.path.abspath(chosen))
    return path if path.suffix == SUFFIX else path.with_name(path.name + SUFFIX)


def _film(context: bpy.types.Context) -> object:
    """The scene's film, sampled over its baked range."""
    scene, manager = context.scene, context.window_manager
    bake, moments = bake_of(scene.playable_environment), []
    manager.progress_begin(0, len(bake.shot.frames))
    try:
        with stand_in_for(scene) as stand_in:
            for frame in bake.shot.frames:
                moments.append(moment_at(stand_in, frame))
                manager.progress_update(len(moments))
    finally:
        manager.progress_end()
    eye, passes = moments[0].camera, wanted_passes(scene, context.view_layer)
    output = Output(eye.width, eye.height, scene.playable_environment.quality, passes)
    return film_of(bake, moments, frames_per_second(scene), output)


def _draw_entry(self: bpy.types.Menu, _context: bpy.types.Context) -> None:
    self.layout.operator("playable.export_shot", text="Playable Environment Shot (.json)")


CLASSES = (PLAYABLE_OT_export_shot,)


def register() -> None:
    """Register the operator and its entry under File, Export."""
    for each in CLASSES:
        bpy.utils.register_class(each)
    bpy.types.TOPBAR_MT_file_export.append(_draw_entry)


def unregister() -> None:
    """Undo `register`."""
    bpy.types.TOPBAR_MT_file_export.remove(_draw_entry)
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
