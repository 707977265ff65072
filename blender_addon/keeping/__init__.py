"""Living in a file: what older versions saved is brought up to date, what is missing is said."""

from ..registration import in_order


def _parts() -> tuple:
    from . import file_events, panels

    return file_events, panels


register, unregister = in_order(_parts)
