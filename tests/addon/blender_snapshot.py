"""Everything that an add-on may add to a running Blender, as a set that can be compared.

What Blender lets nobody list (timers, draw handlers, message subscriptions) is counted from the
moment that `watch` is called.
"""

import atexit
import gc
import threading
from collections import Counter

import bpy
from addon import running

LIVE = Counter()
UNLISTED = (
    (bpy.app.timers, "register", "unregister", "timer"),
    (bpy.types.SpaceView3D, "draw_handler_add", "draw_handler_remove", "draw handler"),
    (bpy.types.SpaceSequenceEditor, "draw_handler_add", "draw_handler_remove", "draw handler"),
    (bpy.types.SpaceImageEditor, "draw_handler_add", "draw_handler_remove", "draw handler"),
    (bpy.types.SpaceNodeEditor, "draw_handler_add", "draw_handler_remove", "draw handler"),
    (bpy.types.SpaceClipEditor, "draw_handler_add", "draw_handler_remove", "draw handler"),
    (atexit, "register", "unregister", "call at exit"),
)
SUBSCRIBED = set()
"""Owners of message subscriptions; who subscribes again after a file was opened counts once."""


def watch():
    """Count from now on what cannot be listed."""
    for owner, add, remove, what in UNLISTED:
        setattr(owner, add, _counting(getattr(owner, add), what, 1))
        setattr(owner, remove, _counting(getattr(owner, remove), what, -1))
    subscribe, clear = bpy.msgbus.subscribe_rna, bpy.msgbus.clear_by_owner

    def subscribed(**named):
        SUBSCRIBED.add(id(named["owner"]))
        return subscribe(**named)

    def cleared(owner):
        SUBSCRIBED.discard(id(owner))
        return clear(owner)

    bpy.msgbus.subscribe_rna, bpy.msgbus.clear_by_owner = subscribed, cleared


def everything():
    """What there is now; two equal sets mean that nothing was left behind between them."""
    return {
        *_names(),
        *_handlers(),
        *_drawn(),
        *_keys(),
        *_processes(),
        *((what, count) for what, count in LIVE.items() if count),
        ("subscriptions", len(SUBSCRIBED)),
    }


def classes(module):
    """Blender's classes that this package defined and that are still registered."""
    gc.collect()
    kinds = (bpy.types.bpy_struct, bpy.types.Operator, bpy.types.PropertyGroup)
    known = {each for kind in kinds for each in _below(kind)}
    ours = [each for each in known if each.__module__.split(".")[0] == module]
    return sorted(each.__name__ for each in ours if each.is_registered)


def _counting(act, what, change):
    def counted(*arguments, **named):
        answer = act(*arguments, **named)
        LIVE[what] += change
        return answer

    return counted


def _names():
    """Types, the attributes of all types of data, and operators."""
    for name in dir(bpy.types):
        kind = getattr(bpy.types, name)
        yield ("type", name)
        if isinstance(kind, type) and issubclass(kind, (bpy.types.ID, bpy.types.bpy_struct)):
            yield from (("attribute", name, each) for each in dir(kind))
    for group in dir(bpy.ops):
        yield from (("operator", group, name) for name in dir(getattr(bpy.ops, group)))


def _handlers():
    for name in dir(bpy.app.handlers):
        listed = getattr(bpy.app.handlers, name)
        if isinstance(listed, list):
            yield from (("handler", name, f"{each.__module__}.{each.__name__}") for each in listed)
            yield ("handlers", name, len(listed))


def _drawn():
    """What was added to menus, headers and panels of Blender, and who may show Blender's panels."""
    for name in dir(bpy.types):
        kind = getattr(bpy.types, name)
        added = getattr(getattr(kind, "draw", None), "_draw_funcs", None)
        if added and len(added) > 1:
            yield ("drawn", name, tuple(each.__qualname__ for each in added))
        yield from (("engine", name, each) for each in getattr(kind, "COMPAT_ENGINES", ()))


def _keys():
    for config in bpy.context.window_manager.keyconfigs:
        for keymap in config.keymaps:
            items = Counter(item.idname for item in keymap.keymap_items)
            # Empty ones do nothing, and other add-ons may mean the same one.
            if items:
                yield ("keys", config.name, keymap.name, tuple(sorted(items.items())))


def _processes():
    yield from (("thread", each.name) for each in threading.enumerate())
    yield from (("child", command) for command in running.children())


def _below(kind):
    for each in kind.__subclasses__():
        yield each
        yield from _below(each)
