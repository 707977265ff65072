"""Why the range that a scene renders must not go on; the engine asks before it draws a frame.

Blender itself renders on when its files cannot be written whole, and calls that a success.
"""

stop_reasons: dict[str, str] = {}
"""Reasons by the scene's name; not a setting, so that no file can keep it."""
