"""German is complete and has nothing else, and words can be looked up where they are shown."""

import ast
import re
from collections import Counter
from string import Formatter
from types import SimpleNamespace

import pytest

bpy = pytest.importorskip("bpy")
pytestmark = pytest.mark.blender

from addon.visible_strings import (  # noqa: E402
    ANYWHERE,
    OPERATOR,
    strings_of_source,
    visible_strings,
)

import blender_addon  # noqa: E402
from blender_addon import translations  # noqa: E402
from blender_addon.translations import german  # noqa: E402

DU = re.compile(r"\b(du|dich|dir|dein|deine[mnrs]?)\b", re.IGNORECASE)


def placeholders(text):
    return Counter(name for _, name, _, _ in Formatter().parse(text) if name is not None)


def edges(text):
    """How a text begins and ends, as far as it must stay so when others stand beside it."""
    return text[:1] in ", ", text[-1:] in " :", text[-1:] == "."


def test_german_has_every_string_that_the_addon_shows(addon):
    assert sorted(visible_strings() - set(german.words())) == []


def test_german_has_no_key_that_the_addon_does_not_show(addon):
    assert sorted(set(german.words()) - visible_strings()) == []


def test_every_key_stands_in_one_room_only():
    keys = [
        (context, english)
        for room in german.ROOMS
        for context, messages in room.MESSAGES.items()
        for english in messages
    ]
    assert [key for key, times in Counter(keys).items() if times > 1] == []


def test_german_keeps_placeholders_and_edges_of_the_english():
    # JSON in a tooltip is no template.
    pairs = [(e, g) for (_, e), g in german.words().items() if "JSON" not in e]
    assert [(e, g) for e, g in pairs if placeholders(e) != placeholders(g)] == []
    assert [(e, g) for e, g in pairs if edges(e) != edges(g)] == []


def test_german_is_german_and_addresses_nobody():
    same = {english for (_, english), said in german.words().items() if english == said}
    assert same == {
        *("Clip", "Index", "Pixel", "Pixel X", "Pose", "Python", "Python: {python}"),
        *("Shot", "Start", "Version"),
    }
    assert [said for said in german.words().values() if DU.search(said) or not said.strip()] == []


def test_one_german_text_stands_for_one_english_one_among_the_operators():
    said = Counter(g for (context, _), g in german.words().items() if context == OPERATOR)
    assert [each for each, times in said.items() if times > 1] == []


def test_registering_hands_german_to_blender_and_unregistering_takes_it_back(monkeypatch):
    known = {}
    catalogue = SimpleNamespace(register=known.__setitem__, unregister=known.__delitem__)
    stand_in = SimpleNamespace(app=SimpleNamespace(translations=catalogue))
    monkeypatch.setattr(translations, "bpy", stand_in)
    assert translations in blender_addon._parts()
    translations.register()
    assert known == {"blender_addon": {"de_DE": german.words()}}
    translations.unregister()
    assert known == {}


@pytest.mark.skipif(not bpy.app.build_options.international, reason="this Blender has no languages")
def test_blender_finds_german_by_context(addon):
    view = bpy.context.preferences.view
    view.language, view.use_translate_interface, view.use_translate_tooltips = "de_DE", True, True
    found = bpy.app.translations.pgettext_iface("Bake Paths", OPERATOR)
    assert found == german.words()[OPERATOR, "Bake Paths"]


SHOWN = [
    ('layout.label(text="Odd")', (ANYWHERE, "Odd")),
    ('layout.label(text="odd" if x else "even")', (ANYWHERE, "even")),
    ('layout.column(heading="Odd")', (ANYWHERE, "Odd")),
    ('layout.operator("playable.odd", text="Odd")', (OPERATOR, "Odd")),
    ('iface_("odd {n}").format(n=1)', (ANYWHERE, "odd {n}")),
    ('iface_("odd", "Operator")', (OPERATOR, "odd")),
    ('allowed(cls, x, "odd")', (ANYWHERE, "odd")),
    ("allowed(cls, x, WHY)", (ANYWHERE, "why")),
    ('on_progress("odd", 1, 2)', (ANYWHERE, "odd")),
]
NOT_SHOWN = [
    'layout.label(text="Odd", translate=False)',
    'layout.label(text=f"Odd {x}")',
    'class X:\n    """Odd."""\n    bl_label = "Odd"',
    'x: StringProperty(name="Odd")',
    'raise ShotError("Odd")',
    'self.report({"INFO"}, "Odd")',
    'x = "odd", "ODD_ONE", "OddOne"',
]


@pytest.mark.parametrize(("source", "pair"), SHOWN)
def test_what_a_source_shows_is_found_with_its_context(source, pair):
    given, others = strings_of_source(ast.parse(source), {"WHY": "why"})
    assert pair in given and not others


def test_sentences_that_reach_a_panel_in_other_ways_are_found():
    given, others = strings_of_source(ast.parse('def f():\n    return "Odd one"'), {})
    assert (given, others) == (set(), {"Odd one"})


@pytest.mark.parametrize("source", NOT_SHOWN)
def test_what_a_source_does_not_show_itself_is_not_asked_of_german(source):
    assert strings_of_source(ast.parse(source), {}) == (set(), set())


def test_the_names_of_a_models_actions_stay_its_own(environment):
    # In its own catalogue Blender knows Left and Right, but not Forward.
    player = next(each for each in environment.objects if each.playable.is_playable)
    operator = bpy.ops.playable.insert_action_key.get_rna_type()
    for owner in (player.playable.bl_rna, operator):
        assert owner.properties["action"].translation_context == "Playable"
