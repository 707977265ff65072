"""The part inside the render border is drawn alone and is the crop of the whole frame."""

import numpy as np
import pytest
from addon.stage import HEIGHT, WIDTH, read_png

from blender_addon.filming.render_border import Border

bpy = pytest.importorskip("bpy")
from blender_addon.scene_bridge import playable_objects  # noqa: E402 - after the check for Blender
from blender_addon.worker.session import Session  # noqa: E402

pytestmark = pytest.mark.blender


class MeasuringEngine(bpy.types.RenderEngine):
    """Finds out how large Blender makes the result."""

    bl_idname = "MEASURING"
    bl_label = "Measuring"
    sizes: list = []

    def render(self, _):
        result = self.begin_result(0, 0, self.resolution_x, self.resolution_y)
        self.sizes.append((result.resolution_x, result.resolution_y))
        self.end_result(result)


@pytest.fixture
def baked(environment):
    bpy.ops.playable.bake_paths()
    environment.render.image_settings.color_mode = "RGB"
    return environment


@pytest.fixture
def asked(monkeypatch):
    """The regions that the worker draws and foresees."""
    regions = {"render": [], "foresee": []}
    for name in regions:
        monkeypatch.setattr(Session, name, noting(regions[name], getattr(Session, name)))
    return regions


def noting(regions, function):
    return lambda self, shot, *rest: regions.append(shot.region) or function(self, shot, *rest)


def put_border(scene, min_x, max_x, min_y, max_y, crop=True):
    render = scene.render
    render.use_border, render.use_crop_to_border = True, crop
    render.border_min_x, render.border_max_x = min_x, max_x
    render.border_min_y, render.border_max_y = min_y, max_y


def border_of_scene(scene):
    render = scene.render
    return Border(
        render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y
    )


def still(scene, path):
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True, scene=scene.name)
    return read_png(path)


def test_the_size_is_blenders_own_for_any_border(scene):
    bpy.utils.register_class(MeasuringEngine)
    scene.render.engine = "MEASURING"
    random, expected = np.random.default_rng(0), []
    MeasuringEngine.sizes.clear()
    for _ in range(60):
        scene.render.resolution_x, scene.render.resolution_y = random.integers(4, 200, 2).tolist()
        # Tenths fall between two single-precision numbers: that is where the pixel is decided.
        shares = np.sort(random.integers(0, 11, (2, 2)) / 10, axis=1)
        put_border(scene, *shares.ravel().tolist())
        region = border_of_scene(scene).region(scene.render.resolution_x, scene.render.resolution_y)
        if min(region[2:]) < 1:
            with pytest.raises(RuntimeError, match="too small"):
                bpy.ops.render.render(scene=scene.name)
            continue
        bpy.ops.render.render(scene=scene.name)
        expected.append(region[2:])
    assert MeasuringEngine.sizes == expected and len(expected) > 20
    bpy.utils.unregister_class(MeasuringEngine)


def test_seven_tenths_of_ten_pixels_are_seven():
    assert Border(0.0, float(np.float32(0.7)), 0.0, 1.0).region(10, 4) == (0, 0, 7, 4)


def test_cropped_or_not_the_pixels_are_those_of_the_whole_frame(baked, asked, tmp_path):
    whole = still(baked, tmp_path / "whole.png")
    random, tried = np.random.default_rng(1), 0
    while tried < 8:
        shares = np.sort(random.random((2, 2)), axis=1).ravel().tolist()
        put_border(baked, *shares)
        region = border_of_scene(baked).region(WIDTH, HEIGHT)
        if min(region[2:]) < 1:
            continue
        left, top, width, height = region
        inside = np.s_[top : top + height, left : left + width]
        cropped = still(baked, tmp_path / "cropped.png")
        assert np.array_equal(cropped, whole[inside])
        baked.render.use_crop_to_border = False
        full = still(baked, tmp_path / "full.png")
        assert full.shape == whole.shape and np.array_equal(full[inside], whole[inside])
        full[inside] = 0
        assert not full.any()
        assert asked["render"][-2:] == [region, region]
        tried += 1
    assert asked["render"][0] is None


def test_passes_are_cropped_like_the_picture(baked, tmp_path, monkeypatch):
    from blender_addon.filming.engine import PlayableEnvironmentEngine

    drawn, hand_over = [], PlayableEnvironmentEngine._hand_over
    monkeypatch.setattr(
        PlayableEnvironmentEngine,
        "_hand_over",
        lambda self, frame, *rest: drawn.append(frame) or hand_over(self, frame, *rest),
    )
    baked.view_layers[0].use_pass_z = True
    for each in playable_objects(baked).values():
        each.playable.use_mask = each.playable.use_layer = True
    baked.playable_environment.use_background = True
    still(baked, tmp_path / "whole.png")
    put_border(baked, 0.1, 0.8, 0.3, 0.9)
    still(baked, tmp_path / "part.png")
    whole, part = drawn
    left, top, width, height = border_of_scene(baked).region(WIDTH, HEIGHT)
    inside = np.s_[top : top + height, left : left + width]
    assert np.array_equal(part.depth, whole.depth[inside])
    assert np.array_equal(part.background, whole.background[inside])
    for name in ("player_1", "player_2"):
        assert np.array_equal(part.masks[name], whole.masks[name][inside])
        assert np.array_equal(part.layers[name], whole.layers[name][inside])


def test_a_range_with_a_border_is_foreseen_with_it(baked, asked, tmp_path):
    put_border(baked, 0.25, 0.75, 0.1, 0.5)
    baked.render.filepath = str(tmp_path / "f_####")
    bpy.ops.render.render(animation=True, scene=baked.name)
    region = border_of_scene(baked).region(WIDTH, HEIGHT)
    assert asked == {"render": [region] * 4, "foresee": [region] * 3}
    alone = still(baked, tmp_path / "alone.png")
    assert np.array_equal(alone, read_png(tmp_path / "f_0001.png"))
