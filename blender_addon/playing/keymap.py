"""Keys of the keyboard that play: 1 to 9 act, 0 deletes, Tab goes to the next playable object.

They count only while a playable Empty is active. Otherwise their polls say no, and Blender goes on
to its own keys, such as those that hide collections.
"""

import bpy

DIGITS = ("ONE", "TWO", "THREE", "FOUR", "FIVE", "SIX", "SEVEN", "EIGHT", "NINE")
EDITORS = (
    ("Object Mode", "EMPTY"),
    ("Dopesheet", "DOPESHEET_EDITOR"),
    ("Graph Editor", "GRAPH_EDITOR"),
)
VIEW = ("Object Non-modal", "EMPTY")
ACT, DELETE, NEXT = "playable.do_action", "playable.delete_action_key", "playable.next_object"


def _keymaps() -> object:
    """Blender's keymaps of add-ons; empty where there is no window manager yet."""
    keyconfig = bpy.data.window_managers[0].keyconfigs.addon if bpy.data.window_managers else None
    return keyconfig.keymaps if keyconfig is not None else ()


def _add(place: tuple[str, str], operator: str, key: str, **settings: object) -> None:
    keymap = _keymaps().new(name=place[0], space_type=place[1])
    item = keymap.keymap_items.new(operator, key, "PRESS")
    for setting, value in settings.items():
        setattr(item.properties, setting, value)


def register() -> None:
    """Add the keys to Blender's."""
    if _keymaps() == ():
        return
    for place in EDITORS:
        for number, digit in enumerate(DIGITS):
            _add(place, ACT, digit, action=number)
        _add(place, DELETE, "ZERO")
    _add(VIEW, NEXT, "TAB")


def unregister() -> None:
    """Take them away again."""
    # Looked for anew: Blender may have made its keymaps anew since, with another file.
    for keymap in _keymaps():
        for item in list(keymap.keymap_items):
            if item.idname in (ACT, DELETE, NEXT):
                keymap.keymap_items.remove(item)
