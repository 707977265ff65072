"""Playing on the timeline: action keys, and the paths that they lead to."""

from ..registration import in_order


def _parts() -> tuple:
    from . import claim_operators, clip_operators, key_operators, operators, panels, watching

    return operators, key_operators, claim_operators, clip_operators, panels, watching


register, unregister = in_order(_parts)
