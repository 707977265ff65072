"""One click puts right what would change the model's colours, and only then it is offered."""

import numpy as np
import pytest
from addon.stage import read_png

bpy = pytest.importorskip("bpy")
from blender_addon.filming.exact_colours import all_colour_changes, draw_colour_changes  # noqa: E402

pytestmark = pytest.mark.blender


class Layout:
    """Notes what a panel draws."""

    def __init__(self):
        self.drawn = []

    def column(self, **_):
        return self

    def label(self, text, **_):
        self.drawn.append(text)

    def operator(self, name, **_):
        self.drawn.append(name)


def agx(scene):
    scene.view_settings.view_transform = "AgX"


def look(scene):
    scene.view_settings.look = "High Contrast"


def brighter(scene):
    scene.view_settings.exposure = 0.5


def curves(scene):
    scene.view_settings.use_curve_mapping = True
    mapping = scene.view_settings.curve_mapping
    mapping.curves[3].points[0].location = 0.0, 0.3
    mapping.update()


def dithered(scene):
    scene.render.dither_intensity = 1.0


def overridden(scene):
    output = scene.render.image_settings
    output.color_management = "OVERRIDE"
    output.view_settings.view_transform = "AgX"


CHANGES = (agx, look, brighter, curves, dithered, overridden)


def film(scene, path):
    scene.render.image_settings.color_mode = "RGB"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True, scene=scene.name)
    return read_png(path)


@pytest.mark.parametrize("change", CHANGES, ids=[each.__name__ for each in CHANGES])
def test_one_click_gives_the_exact_bytes_back(environment, tmp_path, change):
    bpy.ops.playable.bake_paths()
    exact = film(environment, tmp_path / "exact.png")
    assert not bpy.ops.playable.use_exact_colours.poll()
    change(environment)
    assert not np.array_equal(film(environment, tmp_path / "changed.png"), exact)
    assert bpy.ops.playable.use_exact_colours() == {"FINISHED"}
    assert all_colour_changes(environment) == []
    assert np.array_equal(film(environment, tmp_path / "again.png"), exact)


def test_panels_name_what_differs_and_offer_the_button_only_then(environment):
    layout = Layout()
    draw_colour_changes(layout, environment)
    assert layout.drawn == []
    agx(environment)
    dithered(environment)
    draw_colour_changes(layout, environment)
    assert layout.drawn == [
        "Colours differ from the model's",
        "View Transform is AgX, not Standard",
        "Dither is 1, not 0",
        "playable.use_exact_colours",
    ]


def test_blenders_own_panel_shows_it_for_our_engine_and_forgets_it_on_unregistering(scene):
    import blender_addon

    panel, own = bpy.types.RENDER_PT_color_management, "_draw_in_colour_management"

    def shown():
        return [each.__name__ for each in panel._dyn_ui_initialize()].count(own)

    assert shown() == 1
    blender_addon.unregister()
    assert shown() == 0
    blender_addon.register()
    assert shown() == 1


@pytest.mark.skipif(not hasattr(bpy.data, "colorspace"), reason="files have one working space")
def test_another_working_space_is_named_and_nobody_claims_to_have_changed_it(environment, capfd):
    bpy.ops.wm.set_working_color_space(working_space="ACEScg")
    assert "working space is 'ACEScg'" in all_colour_changes(environment)[0]
    agx(environment)
    bpy.ops.playable.use_exact_colours()
    assert "Still different: the file's working space" in capfd.readouterr().out
