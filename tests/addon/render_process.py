"""Blender in a process of its own: `python render_process.py MODE FILM.blend FOLDER [START END]`.

Says `ready` when it is about to render, and does so until it is killed, once, or by Blender's own
Render Animation; what goes wrong is one line and exit code 1, as in `blender -b`.
"""

import os
import sys

import bpy
from addon import stage

import blender_addon
from blender_addon.worker.session import session


def render_for_ever(folder):
    while True:
        bpy.ops.playable.render_to_sequencer(folder=folder, everything=True)


def render_once(folder):
    bpy.ops.playable.render_range(folder=folder)


def render_as_blender_does(folder):
    bpy.context.scene.render.filepath = f"{folder}/frame_####"
    bpy.ops.render.render(animation=True)


MODES = {"for_ever": render_for_ever, "once": render_once, "animation": render_as_blender_does}


def main(mode, film, folder, *frames):
    blender_addon.register()
    bpy.ops.wm.open_mainfile(filepath=film)
    scene = bpy.context.scene
    if frames:
        scene.frame_start, scene.frame_end = map(int, frames)
    session.use_command(stage.FAKE)
    if mode == "for_ever":
        session.facts(scene.playable_environment.model)
    sys.stderr.write("ready\n")
    sys.stderr.flush()
    try:
        MODES[mode](folder)
    except RuntimeError as error:
        sys.stderr.write(f"{error}".strip() + "\n")
        return 1
    finally:
        session.close()
    return 0


if __name__ == "__main__":
    code = main(*sys.argv[1:])
    sys.stderr.flush()
    # Blender 4.5 as a module can wait for ever in its own exit handlers.
    os._exit(code)
