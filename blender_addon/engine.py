"""The render engine: each frame is the baked shot as the scene wants it, drawn by the worker.

Blender makes a new engine for every frame and calls it off the main thread, so nothing is kept
here and nothing in the scene is written. Whatever goes wrong ends in `report({"ERROR"})`: any
other way out of `render` makes Blender save a black frame and carry on.
"""

from collections.abc import Iterator
from contextlib import suppress

import bpy
import numpy as np

from pe_runtime.contract.errors import PlayableEnvironmentError, ShotError
from pe_runtime.contract.shot import DEPTH_PASS, MASK_PASS_PREFIX, Shot

from .bake import Bake, Output, bake_of, take_as_baked, take_of_moment
from .pixels import PassMemory, Window, colour_changes, memory_for
from .replies import RenderedFrame, WorkerCancelledError
from .scene_bridge import frames_per_second, read_moment, wanted_passes
from .session import session

DEPTH = "Depth"
MASK_PREFIX = "Mask "
# Shared by name, but all they show are passes and filters of Blender's own engines.
FOREIGN_PANELS = ("VIEWLAYER_PT_filter", "VIEWLAYER_PT_layer_passes")


class PlayableEnvironmentEngine(bpy.types.RenderEngine):
    """Draws what the scene's playable environment shows to its camera."""

    bl_idname = "PLAYABLE_ENV"
    bl_label = "Playable Environment"
    bl_use_preview = False
    bl_use_postprocess = True
    bl_use_eevee_viewport = True

    def update_render_passes(self, scene: bpy.types.Scene, layer: bpy.types.ViewLayer) -> None:
        """Declare Combined, and Depth and masks where they are switched on."""
        self.register_pass(scene, layer, "Combined", 4, "RGBA", "COLOR")
        # Two objects of one name stop the render, where the error can be reported.
        with suppress(ShotError):
            for name in wanted_passes(scene, layer):
                channel = "Z" if name == DEPTH_PASS else "X"
                self.register_pass(scene, layer, _blender_name(name), 1, channel, "VALUE")

    def render(self, depsgraph: bpy.types.Depsgraph) -> None:
        """Draw the frame that the dependency graph was evaluated at."""
        frame = depsgraph.scene.frame_current
        try:
            self._warn_of_colours(depsgraph.scene)
            self._film(depsgraph)
        except WorkerCancelledError:
            if not self.test_break():
                self.report({"ERROR"}, f"Playable Environment: frame {frame} was cancelled")
        except PlayableEnvironmentError as error:
            self.report({"ERROR"}, f"Playable Environment: frame {frame}: {error}")
        # Anything that escapes, even Ctrl-C, would become a black frame and a success.
        except BaseException as error:  # noqa: BLE001
            text = f"{type(error).__name__}: {error}"
            self.report({"ERROR"}, f"Playable Environment: frame {frame}: {text}")

    def _film(self, depsgraph: bpy.types.Depsgraph) -> None:
        scene = depsgraph.scene
        if scene.render.use_multiview:
            raise ShotError("stereoscopy is on, but the engine draws one view; switch it off")
        settings = scene.playable_environment
        bake = bake_of(settings)
        moment = read_moment(depsgraph)
        passes = wanted_passes(scene, depsgraph.view_layer)
        output = Output(moment.camera.width, moment.camera.height, settings.quality, passes)
        take = take_of_moment(bake, moment, frames_per_second(scene), output)
        drawn = session.render(take, moment.frame, self.test_break, bake.shot)
        self._look_ahead(scene, bake, take, output)
        self._hand_over(drawn, scene.render, moment.scale)

    def _look_ahead(self, scene: bpy.types.Scene, bake: Bake, take: Shot, output: Output) -> None:
        """Have the next frame drawn while Blender saves this one, if both are as baked."""
        render, following = scene.render, take.frame_start + scene.frame_step
        layers = sum(layer.use for layer in scene.view_layers)
        # Where files that exist are skipped or layers take turns, another frame comes next.
        comes_next = self.is_animation and render.use_overwrite and layers == 1
        if not comes_next or following > scene.frame_end or following not in bake.shot.frames:
            return
        if take == take_as_baked(bake, take.frame_start, output):
            session.foresee(take_as_baked(bake, following, output), following, bake.shot)

    def _hand_over(
        self, drawn: RenderedFrame, render: bpy.types.RenderSettings, scale: float
    ) -> None:
        """Give Blender the picture, or the part of it inside the render border."""
        width, height = self.resolution_x, self.resolution_y
        if drawn.rgb.shape != (height, width, 3):
            raise ShotError(
                f"expected a picture of {width}x{height} pixels from the worker, found an array "
                f"of shape {drawn.rgb.shape}"
            )
        left = int(render.border_min_x * width) if render.use_border else 0
        bottom = int(render.border_min_y * height) if render.use_border else 0
        result = self.begin_result(0, 0, width, height)
        window = Window(left, bottom, result.resolution_x, result.resolution_y)
        targets = result.layers[0].passes
        for name, numbers in _pass_numbers(drawn, memory_for(window), scale):
            if (target := targets.get(name)) is not None:
                target.rect.foreach_set(numbers)
        self.end_result(result)

    def _warn_of_colours(self, scene: bpy.types.Scene) -> None:
        if self.is_animation and scene.frame_current != scene.frame_start:
            return
        if changes := colour_changes(scene):
            self.report(
                {"WARNING"},
                "Playable Environment: saved pixels will differ from the model's: "
                + "; ".join(changes),
            )


def _blender_name(name: str) -> str:
    """What Blender calls a pass of a Shot."""
    return DEPTH if name == DEPTH_PASS else MASK_PREFIX + name.removeprefix(MASK_PASS_PREFIX)


def _pass_numbers(
    drawn: RenderedFrame, memory: PassMemory, scale: float
) -> Iterator[tuple[str, np.ndarray]]:
    """The numbers of every pass that was drawn; each is gone when the next one comes."""
    yield "Combined", memory.combined(drawn.rgb)
    if drawn.depth is not None:
        yield DEPTH, memory.depth(drawn.depth, scale)
    for name, mask in drawn.masks.items():
        yield f"{MASK_PREFIX}{name}", memory.values(mask)


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
        panel.COMPAT_ENGINES.add(PlayableEnvironmentEngine.bl_idname)


def unregister() -> None:
    """Undo `register`; a scene that still names the engine keeps the name."""
    for panel in bpy.types.Panel.__subclasses__():
        getattr(panel, "COMPAT_ENGINES", set()).discard(PlayableEnvironmentEngine.bl_idname)
    bpy.utils.unregister_class(PlayableEnvironmentEngine)
