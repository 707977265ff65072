"""The overlay's way onto the screen: what it registers, and the pixels that come of it."""

from types import SimpleNamespace

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")
pytestmark = pytest.mark.blender

SIZE = 64


def test_drawing_begins_and_ends_with_its_two_callbacks(addon):
    from blender_addon.overlay import viewport

    viewport.start(lambda: None, lambda: None)
    assert len(viewport._handles) == 2
    viewport.stop()
    assert viewport._handles == [] and viewport._kept == {}
    viewport.stop()


@pytest.fixture
def screen():
    """An off-screen canvas on which x and y from -1 to 1 are the picture."""
    import gpu
    from mathutils import Matrix

    # Before 5.1 nothing can be drawn without a window.
    if not hasattr(gpu, "init"):
        pytest.skip("this Blender draws in windows only")
    gpu.init()
    canvas = gpu.types.GPUOffScreen(SIZE, SIZE)
    with canvas.bind():
        gpu.state.active_framebuffer_get().clear(color=(0.0, 0.0, 0.0, 1.0))
        with gpu.matrix.push_pop(), gpu.matrix.push_pop_projection():
            gpu.matrix.load_matrix(Matrix.Identity(4))
            gpu.matrix.load_projection_matrix(Matrix.Identity(4))
            yield gpu
    canvas.free()


def pixels(gpu):
    """(rows, columns, 4) float, lowest row first."""
    found = gpu.state.active_framebuffer_get().read_color(0, 0, SIZE, SIZE, 4, 0, "FLOAT")
    return np.array(found.to_list()).reshape(SIZE, SIZE, 4)


def test_lines_and_dots_are_where_and_as_wide_as_they_should_be(screen):
    from mathutils import Matrix

    from blender_addon.overlay.drawing import batches_of, draw_lines
    from blender_addon.overlay.scene_lines import dots, strokes

    red, green = (1.0, 0.0, 0.0, 1.0), (0.0, 1.0, 0.0, 1.0)
    across = np.array([[(-0.4, 0.25, 0.0), (0.4, 0.25, 0.0)]])
    lines = strokes(across, red, 4.0) + dots(np.array([(0.0, -0.25, 0.0)]), green, 8.0)
    # Environment space is scaled by two in the scene.
    region = SimpleNamespace(width=SIZE, height=SIZE)
    draw_lines(batches_of(lines), region, Matrix.Diagonal((2.0, 2.0, 2.0, 1.0)), 1.0)
    drawn = pixels(screen)
    height, width = (drawn[:, SIZE // 2, 0] > 0.5).sum(), (drawn[48, :, 0] > 0.5).sum()
    assert 3 <= height <= 6 and 0.75 * SIZE <= width <= 0.85 * SIZE
    rows, columns = np.nonzero(drawn[..., 1] > 0.5)
    assert abs(rows.mean() - 15.5) <= 1 and abs(columns.mean() - 31.5) <= 1
    assert 30 <= len(rows) <= 80


def test_the_cards_state_is_left_as_it_was(screen):
    from mathutils import Matrix

    from blender_addon.overlay.drawing import batches_of, draw_lines
    from blender_addon.overlay.scene_lines import SceneLines

    state = screen.state
    state.depth_test_set("LESS_EQUAL")
    state.blend_set("ADDITIVE")
    region = SimpleNamespace(width=SIZE, height=SIZE)
    draw_lines(batches_of(SceneLines()), region, Matrix.Identity(4), 1.0)
    assert (state.depth_test_get(), state.blend_get()) == ("LESS_EQUAL", "ADDITIVE")
    state.depth_test_set("NONE")
    state.blend_set("NONE")
