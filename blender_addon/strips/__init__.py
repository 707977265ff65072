"""Rendered frames as strips of the sequencer."""

from ..registration import in_order


def _parts() -> tuple:
    from . import lending, operators, panels, strip_operators

    return lending, operators, strip_operators, panels


register, unregister = in_order(_parts)
