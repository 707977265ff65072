"""The runtime: where it lives, whether it works, how it gets there."""

from ..registration import in_order


def _parts() -> tuple:
    from . import operators, panels, preferences

    return (
        preferences,
        operators,
        panels,
    )


register, unregister = in_order(_parts)
