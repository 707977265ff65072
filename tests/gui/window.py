"""A story told in a real Blender window: step by step, with a picture of what there is to see.

Blender draws between the steps only, so that a story is a generator: it yields seconds to wait, or
a question that must become true, and goes on in a timer.
"""

import os
import shutil
import subprocess
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy

PAUSE, TICK, PATIENCE = 0.8, 0.1, 60.0
"""Seconds: until the window has drawn itself, between looks, and until a wait has failed."""
MOST_TABS = 20
Story = Iterator["float | Callable[[], bool]"]


class StoryError(Exception):
    """A step did not lead where it should."""


class Window:
    """Blender's window and the folder that its pictures go to."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.pictures = folder, 0
        folder.mkdir(parents=True, exist_ok=True)
        for old in folder.glob("*.png"):
            old.unlink()

    def picture(self, name: str) -> Path:
        """Take a picture of the whole screen, numbered in the order of the story."""
        self.pictures += 1
        path = self.folder / f"{self.pictures:02d}_{name}.png"
        if shutil.which("import"):
            subprocess.run(["import", "-window", "root", str(path)], check=True)
        else:
            with self.area_of("VIEW_3D", "PREFERENCES", "IMAGE_EDITOR", "SEQUENCE_EDITOR"):
                bpy.ops.screen.screenshot(filepath=str(path))
        say(f"{path.name}: {path.stat().st_size} bytes")
        return path

    @contextmanager
    def area_of(self, *kinds: str, region: str = "WINDOW") -> Iterator[bpy.types.Area]:
        """Act as if the mouse were in the first area of one of these kinds."""
        for window in bpy.context.window_manager.windows:
            for area in window.screen.areas:
                # The preview of a sequencer has no timeline to act in.
                sees_timeline = getattr(area.spaces.active, "view_type", "SEQUENCER") != "PREVIEW"
                if area.type in kinds and sees_timeline:
                    inside = next(each for each in area.regions if each.type == region)
                    with bpy.context.temp_override(window=window, area=area, region=inside):
                        yield area
                    return
        raise StoryError(f"no area of the kind {' or '.join(kinds)} is open")

    def show_tab(self, tab: str, kind: str = "VIEW_3D") -> Story:
        """Open a tab of an editor's sidebar."""
        with self.area_of(kind, region="UI") as area:
            area.spaces.active.show_region_ui = True
            sidebar = next(each for each in area.regions if each.type == "UI")
            area.tag_redraw()
        yield PAUSE
        # The names of the tabs stand along the right border.
        pointer = sidebar.x + sidebar.width - 12, sidebar.y + sidebar.height - 60
        for _ in range(MOST_TABS):
            if sidebar.active_panel_category == tab:
                return
            # Which one is open can only be read; Ctrl-Tab goes to the next one.
            self.key("TAB", pointer, ctrl=True)
            yield PAUSE
        raise StoryError(f"the sidebar has no tab {tab!r}")

    def middle_of(self, kind: str) -> tuple[int, int]:
        """The pixel in the middle of the first area of a kind."""
        with self.area_of(kind):
            inside = bpy.context.region
            return inside.x + inside.width // 2, inside.y + inside.height // 2

    def key(self, key: str, pointer: tuple[int, int], **modifiers: bool) -> None:
        """Press and release a key or button while the pointer is at a pixel of the window."""
        x, y = pointer
        bpy.context.window.event_simulate(type="MOUSEMOVE", value="NOTHING", x=x, y=y)
        for value in ("PRESS", "RELEASE"):
            bpy.context.window.event_simulate(type=key, value=value, x=x, y=y, **modifiers)

    def close_others(self) -> None:
        """Close every window but the first."""
        for other in list(bpy.context.window_manager.windows)[1:]:
            with bpy.context.temp_override(window=other):
                bpy.ops.wm.window_close()


def tell(story: Story, window: Window, at_end: Callable[[], None]) -> None:
    """Go through a story in timers, then leave Blender: 0, or 1 where a step has failed."""
    waits: list[tuple[Callable[[], bool], float]] = []

    def step() -> float:
        try:
            if waits:
                question, since = waits[-1]
                if not question():
                    if time.monotonic() - since > PATIENCE:
                        raise StoryError(f"still not after {PATIENCE:g} s: {question.__name__}")
                    return TICK
                waits.clear()
            following = next(story)
        except StopIteration:
            leave(at_end, 0)
        except BaseException:  # noqa: BLE001 whatever it is, the story has failed
            sys.stderr.write(traceback.format_exc())
            window.picture("FAILED")
            leave(at_end, 1)
        if callable(following):
            waits.append((following, time.monotonic()))
            return TICK
        return following

    # Persistent, since stories open files.
    bpy.app.timers.register(step, first_interval=2.0, persistent=True)


def leave(at_end: Callable[[], None], code: int) -> None:
    """End Blender at once; its own way out may ask whether to save."""
    at_end()
    say("done" if code == 0 else "FAILED")
    sys.stderr.flush()
    os._exit(code)


def check(condition: object, otherwise: str) -> None:
    """Stop the story where something is not as it should be."""
    if not condition:
        raise StoryError(otherwise)


def say(text: str) -> None:
    """Tell the terminal where the story is."""
    sys.stderr.write(f"walkthrough: {text}\n")
