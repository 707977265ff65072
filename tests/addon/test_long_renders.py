"""Five hundred frames and ten registrations leave no more behind than fifty frames and one."""

import gc

import numpy as np
import psutil
import pytest
from addon.stage import read_png

bpy = pytest.importorskip("bpy")
from blender_addon.worker.session import session  # noqa: E402 - after the check for Blender

pytestmark = pytest.mark.blender
FRAMES, WARM_UP = 500, 50
MEGABYTE = 1 << 20
ALLOWED = 30 * MEGABYTE


@pytest.fixture
def film(environment, tmp_path):
    environment.frame_end = FRAMES
    environment.view_layers[0].use_pass_z = True
    environment.render.image_settings.color_mode = "RGB"
    environment.render.filepath = str(tmp_path / "f_####")
    bpy.ops.playable.bake_paths()
    return environment


@pytest.fixture
def memory():
    """Megabytes of Blender and of the worker, noted by the frames that were written."""
    noted = {}

    def note(scene, *_):
        worker = psutil.Process(session.worker_pid)
        noted[scene.frame_current] = psutil.Process().memory_info().rss, worker.memory_info().rss

    bpy.app.handlers.render_write.append(note)
    yield noted
    bpy.app.handlers.render_write.remove(note)


def test_memory_stays_flat_over_500_frames_in_blender_and_in_the_worker(film, memory, tmp_path):
    bpy.ops.render.render(animation=True, scene=film.name)
    assert list(memory) == list(range(1, FRAMES + 1))
    for warm, end in zip(memory[WARM_UP], memory[FRAMES], strict=True):
        assert end - warm < ALLOWED
    assert len(list(tmp_path.glob("f_*.png"))) == FRAMES
    first, last = (read_png(tmp_path / f"f_{frame:04d}.png") for frame in (1, FRAMES))
    assert not np.array_equal(first, last)


def test_ten_registrations_and_renders_cost_no_more_memory_than_the_second(film):
    from addon.stage import FAKE

    import blender_addon

    film.frame_end = 3
    sizes = []
    for _ in range(12):
        blender_addon.unregister()
        assert session.worker_pid is None
        blender_addon.register()
        session.use_command(FAKE)
        bpy.ops.render.render(animation=True, scene=film.name)
        gc.collect()
        sizes.append(psutil.Process().memory_info().rss)
    assert sizes[-1] - sizes[1] < ALLOWED
