"""What mouse and keys mean to a tool that works on the picture; no `bpy` here."""

from typing import Protocol

RUNNING, PASSED_ON, DONE, CANCELLED = "running", "passed on", "done", "cancelled"
NAVIGATION = (
    *("MIDDLEMOUSE", "WHEELUPMOUSE", "WHEELDOWNMOUSE", "WHEELINMOUSE", "WHEELOUTMOUSE"),
    *("TRACKPADPAN", "TRACKPADZOOM", "MOUSEROTATE", "MOUSESMARTZOOM", "NDOF_MOTION"),
    *("HOME", "NUMPAD_PLUS", "NUMPAD_MINUS", "TIMER", "WINDOW_DEACTIVATE"),
)
"""Events with which the artist looks closer while the tool waits."""
FINISHING = ("RET", "NUMPAD_ENTER", "SPACE")
REMOVING = ("X", "DEL", "BACK_SPACE")


class Tool(Protocol):
    """Something that is drawn on the picture with the left mouse button."""

    dragging: bool
    finished: bool

    def press(self, u: float, v: float, reach: float) -> None:
        """The button goes down at a pixel; `reach` pixels around it count as hit."""

    def move(self, u: float, v: float) -> None:
        """The mouse is at a pixel."""

    def release(self, u: float, v: float) -> None:
        """The button goes up at a pixel."""

    def let_go(self) -> None:
        """What is in the hand goes back to where it was."""

    def advance(self) -> None:
        """Go on to the next thing to be drawn."""

    def remove(self) -> None:
        """Take away the thing that is drawn now."""


def respond(tool: Tool, kind: str, value: str, pixel: tuple[float, float], reach: float) -> str:
    """Let a tool do what an event means.

    Args:
        tool: Changed in place.
        kind: Blender's type of the event.
        value: Blender's value of it: PRESS, RELEASE and so on.
        pixel: Where the mouse is, in pixels of the picture; also beyond it.
        reach: Pixels of the picture within which a place is hit.

    Returns:
        RUNNING; PASSED_ON to the view, which is being navigated; DONE; or CANCELLED.
    """
    if kind in NAVIGATION:
        return PASSED_ON
    if kind == "MOUSEMOVE":
        tool.move(*pixel)
    elif kind == "LEFTMOUSE":
        _click(tool, value, pixel, reach)
    elif value == "PRESS":
        return _key(tool, kind)
    return DONE if tool.finished else RUNNING


def _click(tool: Tool, value: str, pixel: tuple[float, float], reach: float) -> None:
    if value == "RELEASE":
        tool.release(*pixel)
    elif value in ("PRESS", "DOUBLE_CLICK"):
        tool.press(*pixel, reach)


def _key(tool: Tool, kind: str) -> str:
    if kind in ("ESC", "RIGHTMOUSE"):
        # The first one only drops what is in the hand.
        if not tool.dragging:
            return CANCELLED
        tool.let_go()
    elif kind in FINISHING:
        tool.let_go()
        return DONE
    elif kind == "TAB":
        tool.advance()
    elif kind in REMOVING:
        tool.remove()
    return DONE if tool.finished else RUNNING
