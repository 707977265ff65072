"""A picture on disk, and for tests of Blender a fresh file with the add-on and a fake worker."""

import pytest
from addon import stage

from pe_runtime.images import write_png


@pytest.fixture
def picture(tmp_path):
    path = tmp_path / "picture.png"
    write_png(path, stage.picture_of())
    return path


@pytest.fixture
def addon():
    """The registered add-on in an empty factory file; its session talks to the fake worker."""
    bpy = pytest.importorskip("bpy")
    import blender_addon
    from blender_addon.worker.session import session

    bpy.ops.wm.read_factory_settings(use_empty=True)
    blender_addon.register()
    session.use_command(stage.FAKE)
    yield session
    blender_addon.unregister()


@pytest.fixture
def scene(addon):
    """A small scene, frames 1 to 4 at 10 fps, whose camera sees the picture."""
    import bpy

    from blender_addon.scene_bridge import look_through

    made = bpy.data.scenes[0]
    made.frame_start, made.frame_end, made.render.fps = 1, 4, 10
    holder = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    made.collection.objects.link(holder)
    made.camera = holder
    look_through(holder, made.render, stage.front_camera())
    return made


@pytest.fixture
def environment(scene, picture):
    """The scene with the picture's environment: a root and two playable Empties."""
    import json

    import bpy

    boxes = json.dumps(stage.BOXES)
    bpy.ops.playable.new_environment(image=str(picture), model="fake", boxes=boxes)
    return scene
