"""What a file lacks for its environment to be played and rendered, in words."""

from collections.abc import Iterator
from pathlib import Path

import bpy

from pe_runtime.contract.errors import ShotError

from ..bake import bake_of
from ..playing.claims import left_out
from ..scene_bridge import playable_objects
from ..strips.placing import strips_of

MODEL_SUFFIX = ".safetensors"


def problems_of(scene: bpy.types.Scene) -> list[str]:
    """One sentence for everything that is missing or broken; empty where all is well.

    Cheap enough for a panel: no worker is asked, and only a few files are looked for.
    """
    settings = scene.playable_environment
    if settings.root is None:
        return []
    if text := settings.of_newer_addon():
        return [text]
    return [
        *_missing_model(settings.model),
        *_missing_picture(settings.image_path),
        *_object_problems(scene),
        *(_missing_frames(settings.job) if settings.job else ()),
    ]


def _missing_model(model: str) -> Iterator[str]:
    # A name without a suffix is that of a built-in model, which lies with the runtime.
    if Path(model).suffix == MODEL_SUFFIX and not Path(bpy.path.abspath(model)).is_file():
        yield f"The model file {model} is missing; choose it again in Environment"


def _missing_picture(path: str) -> Iterator[str]:
    if path and not Path(bpy.path.abspath(path)).is_file():
        yield (
            f"The picture {path} is missing; its environment is in this file, so that rendering "
            "goes on, but New Playable Environment needs it"
        )


def _object_problems(scene: bpy.types.Scene) -> Iterator[str]:
    settings = scene.playable_environment
    if settings.root.name not in scene.objects:
        yield f"The environment root {settings.root.name!r} is not in this scene; link it again"
    try:
        playable_objects(scene)
    except ShotError as error:
        yield str(error)
        return
    for name in left_out(scene):
        yield f"{name!r} is in the picture but has no Empty; press Bring Back in Paths"
    if settings.bake_text is not None:
        try:
            bake_of(settings)
        except ShotError as error:
            yield str(error)


def _missing_frames(job: str) -> Iterator[str]:
    for strip in (each for scene in bpy.data.scenes for each in strips_of(scene, job)):
        folder = Path(bpy.path.abspath(strip.directory))
        # One look at the folder: a panel asks for every frame of a film at each redraw.
        there = {file.name for file in folder.iterdir()} if folder.is_dir() else set()
        missing = [each for each in strip.elements if each.filename not in there]
        if missing:
            yield (
                f"{len(missing)} of {len(strip.elements)} frames of the strip {strip.name!r} are "
                f"missing in {folder}; press Render to Sequencer"
            )
