"""The render engine: each frame is the baked shot as the scene wants it, drawn by the worker.

Blender makes a new engine for every frame and calls it off the main thread, so nothing is kept
here and nothing in the scene is written. Whatever goes wrong ends in `report({"ERROR"})`: any
other way out of `render` makes Blender save a black frame and carry on.
"""

import dataclasses
from collections.abc import Iterator
from contextlib import suppress

import bpy

from pe_runtime.contract.errors import PlayableEnvironmentError, ShotError
from pe_runtime.contract.shot import Region, Shot

from ..bake import Bake, Output, bake_of, is_as_baked, take_as_baked, take_of_moment
from ..preview.ticking import keep_ticking, viewport_of
from ..scene_bridge import ENGINE, frames_per_second, read_moment, wanted_passes
from ..worker.replies import RenderedFrame, WorkerCancelledError
from ..worker.session import session
from .exact_colours import all_colour_changes
from .frame_origin import frame_origin
from .frame_watch import FrameWatch, place_in_range
from .pace import pace
from .pixels import memory_for
from .range_stop import stop_reasons
from .render_border import border_of
from .render_passes import COMBINED, blender_pass, pass_numbers
from .written_files import check_room

# Shared by name, but all they show are passes and filters of Blender's own engines.
FOREIGN_PANELS = ("VIEWLAYER_PT_filter", "VIEWLAYER_PT_layer_passes")
LAST_WORDS = "\nThe worker's last words:\n"


class PlayableEnvironmentEngine(bpy.types.RenderEngine):
    """Draws what the scene's playable environment shows to its camera."""

    bl_idname = ENGINE
    bl_label = "Playable Environment"
    bl_use_preview = False
    bl_use_postprocess = True
    bl_use_eevee_viewport = True

    def update_render_passes(self, scene: bpy.types.Scene, layer: bpy.types.ViewLayer) -> None:
        """Declare Combined and whatever else is switched on."""
        self.register_pass(scene, layer, COMBINED, 4, "RGBA", "COLOR")
        # Two objects of one name stop the render, where the error can be reported.
        with suppress(ShotError):
            for each in map(blender_pass, wanted_passes(scene, layer)):
                count = len(each.channels)
                self.register_pass(scene, layer, each.name, count, each.channels, each.kind)

    def render(self, depsgraph: bpy.types.Depsgraph) -> None:
        """Draw the frame that the dependency graph was evaluated at."""
        frame = depsgraph.scene.frame_current
        try:
            self._warn_of_colours(depsgraph.scene)
            self._film(depsgraph)
        except WorkerCancelledError:
            if not self.test_break():
                self._fail(frame, "it was cancelled; render again")
        except PlayableEnvironmentError as error:
            self._fail(frame, one_line(str(error)))
        # Anything that escapes, even Ctrl-C, would become a black frame and a success.
        except BaseException as error:  # noqa: BLE001
            self._fail(frame, one_line(f"{type(error).__name__}: {error}"))

    def view_update(self, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> None:
        """Take in what has changed in the scene of a viewport in Rendered shading."""
        viewport_of(self).read(depsgraph)
        keep_ticking()

    def view_draw(self, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> None:
        """Draw such a viewport."""
        viewport_of(self).draw(self, context, depsgraph)
        keep_ticking()

    def _fail(self, frame: int, reason: str) -> None:
        self.report({"ERROR"}, f"Playable Environment: frame {frame}: {reason}")

    def _film(self, depsgraph: bpy.types.Depsgraph) -> None:
        scene = depsgraph.scene
        if (reason := stop_reasons.get(scene.name)) is not None:
            raise ShotError(reason)
        if scene.render.use_multiview:
            raise ShotError("stereoscopy is on, but the engine draws one view; switch it off")
        bake, moment = bake_of(scene.playable_environment), read_moment(depsgraph)
        output = Output(
            moment.camera.width,
            moment.camera.height,
            scene.playable_environment.quality,
            wanted_passes(scene, depsgraph.view_layer),
        )
        if self.is_animation:
            channels = len("RGBA") + sum(len(blender_pass(name).channels) for name in output.passes)
            check_room(scene, self.resolution_x * self.resolution_y, channels)
        region = self._region(scene)
        take = take_of_moment(bake, moment, frames_per_second(scene), output)
        watch = self._watch(scene, take)
        origin = frame_origin(take, bake.shot, session.facts(take.model, watch))
        drawn = session.render(_only(take, region), moment.frame, watch, bake.shot)
        watch.finish()
        self._look_ahead(scene, bake, take, output)
        self._hand_over(drawn, moment.scale, depsgraph.view_layer.name)
        for name, value in origin.items():
            self.get_result().stamp_data_add_field(name, value)

    def _region(self, scene: bpy.types.Scene) -> Region | None:
        """The part of the frame that is rendered; None for all of it."""
        if (border := border_of(scene.render)) is None:
            return None
        return border.region(self.resolution_x, self.resolution_y)

    def _watch(self, scene: bpy.types.Scene, take: Shot) -> FrameWatch:
        frames = range(scene.frame_start, scene.frame_end + 1, scene.frame_step)
        kind = scene.name, take.model, self.resolution_x, self.resolution_y, take.quality
        kind += take.passes, border_of(scene.render)
        place = place_in_range(kind, take.frame_start, frames, self.is_animation)
        return FrameWatch(self, place, pace, lambda: session.doing)

    def _look_ahead(self, scene: bpy.types.Scene, bake: Bake, take: Shot, output: Output) -> None:
        """Have the next frame drawn while Blender saves this one, if both are as baked."""
        render, following = scene.render, take.frame_start + scene.frame_step
        layers = sum(layer.use for layer in scene.view_layers)
        # Where files that exist are skipped or layers take turns, another frame comes next.
        comes_next = self.is_animation and render.use_overwrite and layers == 1
        if not comes_next or following > scene.frame_end or following not in bake.shot.frames:
            return
        if is_as_baked(bake, take, output):
            ahead = _only(take_as_baked(bake, following, output), self._region(scene))
            session.foresee(ahead, following, bake.shot, self.test_break)

    def _hand_over(self, drawn: RenderedFrame, scale: float, layer: str) -> None:
        """Give Blender the picture and the passes of a view layer."""
        # Unless it is named, the result is that of the scene's first view layer.
        result = self.begin_result(0, 0, self.resolution_x, self.resolution_y, layer=layer)
        width, height = result.resolution_x, result.resolution_y
        if drawn.rgb.shape != (height, width, 3):
            self.end_result(result, cancel=True)
            raise ShotError(
                f"expected a picture of {width}x{height} pixels from the worker, found an array "
                f"of shape {drawn.rgb.shape}"
            )
        targets = result.layers[0].passes
        for name, numbers in pass_numbers(drawn, memory_for(width, height), scale):
            if (target := targets.get(name)) is not None:
                target.rect.foreach_set(numbers)
        self.end_result(result)

    def _warn_of_colours(self, scene: bpy.types.Scene) -> None:
        if self.is_animation and scene.frame_current != scene.frame_start:
            return
        if changes := all_colour_changes(scene):
            self.report(
                {"WARNING"},
                "Playable Environment: saved pixels will differ from the model's: "
                + "; ".join(changes),
            )


def one_line(text: str) -> str:
    """A message for a log that is read line by line; of a worker's last words the very last."""
    said, _, words = text.partition(LAST_WORDS)
    last = next((line for line in reversed(words.splitlines()) if line.strip()), "")
    line = " ".join(said.split())
    return f"{line}; its last words: {' '.join(last.split())}" if last else line


def _only(take: Shot, region: Region | None) -> Shot:
    """The part of a take that is seen through the render border."""
    return take if region is None else dataclasses.replace(take, region=region)


def _panels_for_all_engines() -> Iterator[type]:
    """Blender's own panels that a plain engine shares: output, camera, view layer and so on."""
    # The engines that share panels say so in COMPAT_ENGINES; Cycles and EEVEE add their own.
    for panel in bpy.types.Panel.__subclasses__():
        shared = "BLENDER_RENDER" in getattr(panel, "COMPAT_ENGINES", ())
        if shared and panel.__name__ not in FOREIGN_PANELS:
            yield panel


def register() -> None:
    """Register the engine and show Blender's common panels for it."""
    bpy.utils.register_class(PlayableEnvironmentEngine)
    for panel in _panels_for_all_engines():
        panel.COMPAT_ENGINES.add(ENGINE)


def unregister() -> None:
    """Undo `register`; a scene that still names the engine keeps the name."""
    for panel in bpy.types.Panel.__subclasses__():
        getattr(panel, "COMPAT_ENGINES", set()).discard(ENGINE)
    bpy.utils.unregister_class(PlayableEnvironmentEngine)
