"""Every panel draws in an empty file, before and after baking; long texts become lines."""

from types import SimpleNamespace

import pytest
from addon.visible_strings import own_classes

bpy = pytest.importorskip("bpy")
from blender_addon import panel  # noqa: E402 - after the check for Blender
from blender_addon.scene_bridge import playable_objects  # noqa: E402

pytestmark = pytest.mark.blender
LONG = "a warning that is far longer than what the sidebar shows in one line at its usual width"


class Layout:
    """Stands in for Blender's layout, which needs a window: notes labels and operators."""

    def __init__(self, shown=None):
        self.__dict__["shown"] = [] if shown is None else shown

    def label(self, text="", icon="NONE", **_):
        self.shown.append((icon, text))

    def operator(self, name, **_):
        getattr(bpy.ops.playable, name.partition(".")[2])
        return SimpleNamespace()

    def prop(self, owner, name, **_):
        assert name in owner.bl_rna.properties, name

    def panel(self, *_, **__):
        return self, self

    panel_prop = panel

    def __getattr__(self, name):
        return lambda *_, **__: self

    def __setattr__(self, name, value):
        pass


def draw_all(width=300):
    """What the add-on's panels say in the scene that is open, as far as they show themselves."""
    window = SimpleNamespace(
        scene=bpy.context.scene,
        object=bpy.context.view_layer.objects.active,
        view_layer=bpy.context.view_layer,
        # In the background Blender knows no scale.
        preferences=SimpleNamespace(system=SimpleNamespace(ui_scale=1.0)),
        region=SimpleNamespace(width=width),
        workspace=None,
        space_data=None,
    )
    shown = {}
    for each in own_classes(bpy.types.Panel):
        if not hasattr(each, "poll") or each.poll(window):
            layout = Layout()
            # Blender makes panels itself; what they draw needs no more than a layout.
            each.draw(SimpleNamespace(layout=layout, bl_label=each.bl_label), window)
            shown[each.__name__] = layout.shown
    return shown


def test_an_empty_file_shows_the_way_to_an_environment_and_nothing_that_needs_one(scene):
    said = draw_all()
    assert "PLAYABLE_PT_environment" in said
    assert not {"PLAYABLE_PT_paths", "PLAYABLE_PT_styles", "PLAYABLE_PT_output"} & set(said)


def test_all_panels_draw_before_and_after_baking(environment):
    target = playable_objects(environment)["player_1"]
    bpy.context.view_layer.objects.active = target
    assert ("INFO", "Nothing is baked yet") in draw_all()["PLAYABLE_PT_paths"]
    bpy.ops.playable.bake_paths()
    bpy.ops.playable.do_action(action=1)
    target.playable.overrides.style = "PICTURE"
    assert "PLAYABLE_PT_overrides" in draw_all()


def test_a_long_text_becomes_lines_and_has_its_icon_once():
    layout = Layout()
    panel.wrapped_label(layout, LONG, "ERROR")
    assert " ".join(text for _, text in layout.shown) == LONG
    assert [icon for icon, _ in layout.shown] == ["ERROR"] + ["BLANK1"] * (len(layout.shown) - 1)
    assert 1 < len(layout.shown) and max(len(text) for _, text in layout.shown) <= 36


def test_lines_without_an_icon_stay_at_the_border():
    layout = Layout()
    panel.wrapped_label(layout, "one\ntwo", characters=10)
    assert layout.shown == [("NONE", "one"), ("NONE", "two")]


def test_in_a_narrow_sidebar_what_needs_attention_has_shorter_lines(environment):
    bpy.data.texts.remove(environment.playable_environment.state_text)
    environment.playable_environment.image_path = "/gone/picture.png"
    longest = [
        max(len(text) for _, text in draw_all(width)["PLAYABLE_PT_problems"])
        for width in (200, 300, 500)
    ]
    assert longest == sorted(longest) and longest[0] <= 20 < longest[1] < longest[2]
