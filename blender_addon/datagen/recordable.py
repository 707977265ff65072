"""What the recorder needs of a Blender scene: marked playable objects, cameras, a frame range.

Marks are custom properties, so any .blend can be made recordable by hand:

    pe_playable   on the root Empty or object of a playable object: its name (text)
    pe_action     on the same object: whole number, the action's index; keys hold until the next
    pe_view       on further cameras: 1 for the second view, ...; the scene's camera is view 0
"""

from dataclasses import dataclass
from pathlib import Path

import bpy

from blender_addon.fcurves import make_stepped
from pe_runtime.contract.errors import EpisodeError

PLAYABLE = "pe_playable"
ACTION = "pe_action"
VIEW = "pe_view"
UNKNOWN_ACTION = -1


@dataclass(frozen=True)
class Recordable:
    """A scene ready for recording.

    Attributes:
        scene: The Blender scene; frame_start to frame_end (in steps of frame_step) is one episode.
        name: What the data set calls the scene.
        actions: Names of the actions; empty when unknown.
        steps_per_second: Recorded frames per second.
    """

    scene: bpy.types.Scene
    name: str
    actions: tuple[str, ...]
    steps_per_second: float

    @property
    def frames(self) -> range:
        """The scene frames to record."""
        return range(self.scene.frame_start, self.scene.frame_end + 1, self.scene.frame_step)

    def playables(self) -> dict[str, bpy.types.Object]:
        """Root object of every playable object, ordered by name.

        Raises:
            EpisodeError: If two roots bear the same name, or one hangs below another.
        """
        roots = [o for o in self.scene.objects if PLAYABLE in o.keys()]
        named = {str(root[PLAYABLE]): root for root in roots}
        if len(named) < len(roots):
            names = sorted(str(root[PLAYABLE]) for root in roots)
            raise EpisodeError(
                f"scene {self.name}: {PLAYABLE} names are {names}; give each root its own name"
            )
        nested = [o.name for o in roots for part in o.children_recursive if part in roots]
        if nested:
            raise EpisodeError(
                f"scene {self.name}: {nested[0]} has another playable object below it; mark the "
                "root of each object only"
            )
        return dict(sorted(named.items()))

    def cameras(self, views: int) -> list[bpy.types.Object]:
        """The first `views` cameras: the scene's own, then by `pe_view`.

        Raises:
            EpisodeError: If the scene has fewer.
        """
        marked = {
            int(o[VIEW]): o for o in self.scene.objects if o.type == "CAMERA" and VIEW in o.keys()
        }
        marked[0] = self.scene.camera
        missing = [n for n in range(views) if marked.get(n) is None]
        if missing:
            raise EpisodeError(
                f"scene {self.name}: expected {views} cameras, found none for view {missing[0]}; "
                f"set the scene's camera, and give others the custom property {VIEW} = 1, 2, ..."
            )
        return [marked[n] for n in range(views)]


def open_blend(path: Path) -> Recordable:
    """Open a .blend file whose playable objects are marked.

    Raises:
        EpisodeError: If the file is missing, cannot be opened, or marks no playable object.
    """
    if not path.is_file():
        raise EpisodeError(f"scene {path} does not exist; give a .blend file")
    try:
        bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False)
    except RuntimeError as error:
        raise EpisodeError(f"scene {path} cannot be opened by Blender: {error}") from error
    scene = bpy.context.scene
    rate = scene.render.fps / scene.render.fps_base / scene.frame_step
    found = Recordable(scene, path.stem, (), rate)
    if not found.playables():
        raise EpisodeError(
            f"scene {path}: expected playable objects, found none; give the root of each "
            f"the custom property {PLAYABLE} with its name"
        )
    for root in found.playables().values():
        # Blender slides whole-number properties from key to key, through every action between.
        make_stepped(root, f'["{ACTION}"]')
    return found


def keep_first_frames(source: Recordable, count: int) -> None:
    """Shorten the episode to its first `count` frames."""
    scene = source.scene
    scene.frame_end = min(scene.frame_end, scene.frame_start + (count - 1) * scene.frame_step)
