"""Registering several parts in order, and undoing it in the reverse order. No `bpy` here."""

from collections.abc import Callable
from types import ModuleType

Step = Callable[[], None]


def in_order(parts: Callable[[], tuple[ModuleType, ...]]) -> tuple[Step, Step]:
    """A package's `register` and `unregister`.

    Args:
        parts: Imports and returns the modules that register something, in an order in which each
            finds its predecessors; called only then, so that importing a package stays cheap.
    """

    def register() -> None:
        for part in parts():
            part.register()

    def unregister() -> None:
        for part in reversed(parts()):
            part.unregister()

    return register, unregister
