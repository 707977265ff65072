"""To be written."""


def register() -> None:
    """Nothing yet."""


def unregister() -> None:
    """Nothing yet."""
