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


def add_keys(manager: bpy.types.WindowManager) -> None:
    """Add the keys to Blender's.

    Args:
        manager: The context's: while an add-on is being enabled, `bpy.data` gives none.
    """
    if _keymaps(manager) is None:
        return
    for place in EDITORS:
        for number, digit in enumerate(DIGITS):
            _add(manager, place, ACT, digit, action=number)
        _add(manager, place, DELETE, "ZERO")
    _add(manager, VIEW, NEXT, "TAB")


def remove_keys(manager: bpy.types.WindowManager) -> None:
    """Take them away again."""
    # Looked for anew: Blender may have made its keymaps anew since, with another file.
    for keymap in _keymaps(manager) or ():
        for item in list(keymap.keymap_items):
            if item.idname in (ACT, DELETE, NEXT):
                keymap.keymap_items.remove(item)


def _keymaps(manager: bpy.types.WindowManager) -> bpy.types.KeyMaps | None:
    """Blender's keymaps of add-ons; None where it has none, as in the background."""
    keyconfig = manager.keyconfigs.addon
    return None if keyconfig is None else keyconfig.keymaps


def _add(
    manager: bpy.types.WindowManager,
    place: tuple[str, str],
    operator: str,
    key: str,
    **settings: object,
) -> None:
    keymap = _keymaps(manager).new(name=place[0], space_type=place[1])
    item = keymap.keymap_items.new(operator, key, "PRESS")
    for setting, value in settings.items():
        setattr(item.properties, setting, value)
