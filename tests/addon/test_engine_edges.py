"""Renders at the edges: tiny and odd sizes, single frames, no camera, other kinds of cameras."""

import numpy as np
import pytest
from addon.stage import read_png

bpy = pytest.importorskip("bpy")
from blender_addon.filming.engine import LAST_WORDS, one_line  # noqa: E402 - after the check for Blender
from blender_addon.worker.session import session  # noqa: E402

pytestmark = pytest.mark.blender


@pytest.fixture
def baked(environment):
    bpy.ops.playable.bake_paths()
    environment.render.image_settings.color_mode = "RGB"
    return environment


def still(scene, path):
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True, scene=scene.name)
    return read_png(path)


@pytest.mark.parametrize(
    ("width", "height", "percentage"),
    [(4, 4, 100), (100, 100, 1), (5, 7, 100), (333, 17, 100), (64, 36, 33), (4, 200, 100)],
)
def test_any_size_is_drawn_pixel_by_pixel(baked, tmp_path, width, height, percentage):
    render = baked.render
    render.resolution_x, render.resolution_y = width, height
    render.resolution_percentage = percentage
    baked.view_layers[0].use_pass_z = True
    size = max(width * percentage // 100, 1), max(height * percentage // 100, 1)
    assert still(baked, tmp_path / "odd.png").shape == (size[1], size[0], 3)


def test_a_percentage_that_leaves_no_pixel_is_said(baked, tmp_path):
    render = baked.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = 50, 50, 1
    with pytest.raises(RuntimeError, match="too small|leaves 0x0 pixels"):
        still(baked, tmp_path / "none.png")
    assert not (tmp_path / "none.png").exists()


def test_a_border_without_a_pixel_is_said(baked, tmp_path):
    render = baked.render
    render.use_border = True
    render.border_min_x = render.border_max_x = 0.5
    with pytest.raises(RuntimeError, match="too small"):
        still(baked, tmp_path / "none.png")
    assert not (tmp_path / "none.png").exists()


def test_a_range_of_one_frame_and_a_range_with_steps(baked, tmp_path):
    baked.frame_start = baked.frame_end = 2
    baked.render.filepath = str(tmp_path / "one_####")
    bpy.ops.render.render(animation=True, scene=baked.name)
    baked.frame_start, baked.frame_end, baked.frame_step = 1, 4, 3
    baked.render.filepath = str(tmp_path / "step_####")
    bpy.ops.render.render(animation=True, scene=baked.name)
    assert sorted(path.name for path in tmp_path.glob("*_*.png")) == [
        "one_0002.png",
        "step_0001.png",
        "step_0004.png",
    ]


def test_no_camera_is_said_by_blender_itself_and_nothing_is_written(baked, tmp_path):
    baked.camera = None
    with pytest.raises(RuntimeError, match="no camera"):
        still(baked, tmp_path / "none.png")
    assert not (tmp_path / "none.png").exists()


def test_something_else_than_a_camera_is_looked_through_by_nobody(baked, tmp_path):
    empty = bpy.data.objects.new("Empty", None)
    baked.collection.objects.link(empty)
    baked.camera = empty
    with pytest.raises(RuntimeError, match="no camera"):
        still(baked, tmp_path / "none.png")
    assert not (tmp_path / "none.png").exists()


@pytest.mark.parametrize("kind", ["ORTHO", "PANO"])
def test_cameras_that_are_no_pinholes_are_refused_by_name(baked, tmp_path, kind):
    baked.camera.data.type = kind
    with pytest.raises(RuntimeError, match=f"camera type is {kind}.*Perspective") as caught:
        still(baked, tmp_path / "none.png")
    assert len(str(caught.value).splitlines()) == 1
    assert not (tmp_path / "none.png").exists()


def test_two_cameras_by_markers_are_both_followed(baked, tmp_path):
    other = baked.camera.copy()
    other.data = baked.camera.data.copy()
    other.location.x += 2.0
    baked.collection.objects.link(other)
    baked.timeline_markers.new("first", frame=1).camera = baked.camera
    baked.timeline_markers.new("second", frame=3).camera = other
    baked.render.filepath = str(tmp_path / "f_####")
    bpy.ops.render.render(animation=True, scene=baked.name)
    frames = [read_png(tmp_path / f"f_{frame:04d}.png") for frame in range(1, 5)]
    assert len({frame.tobytes() for frame in frames}) == 4
    red = [(frame[..., 0] == 230).any(axis=0) for frame in frames]
    assert np.flatnonzero(red[3]).max() < np.flatnonzero(red[0]).max()


def test_progress_ends_at_one_and_words_tell_the_stages(baked, addon, monkeypatch):
    from blender_addon.filming import engine, frame_watch

    shares, words = [], []

    class Bar:
        def __init__(self, bar):
            self.test_break = bar.test_break

        def update_progress(self, share):
            shares.append(share)

        def update_stats(self, _, said):
            words.append(said)

    def watch(bar, *rest):
        return frame_watch.FrameWatch(Bar(bar), *rest)

    addon.close()
    monkeypatch.setattr(engine, "FrameWatch", watch)
    bpy.ops.render.render(animation=True, scene=baked.name)
    assert shares == sorted(shares) and shares[-1] == 1.0
    assert words[0].startswith("Starting the runtime · frame 1 of 4")
    assert session.doing == ""


def test_a_message_for_a_log_is_one_line_with_the_very_last_words():
    text = f"the worker ended{LAST_WORDS}Traceback:\n  deep inside\nout of memory\n\n"
    assert one_line(text) == "the worker ended; its last words: out of memory"
    assert one_line("two\n  lines") == "two lines"
    assert one_line("all is said") == "all is said"
