"""Actions from clip: what the players of a strip or a movie clip do becomes action keys."""

from collections.abc import Callable, Iterator, Mapping, Sequence

import bpy
import numpy as np
from bpy.props import EnumProperty

from pe_runtime.contract.camera import Camera
from pe_runtime.contract.errors import PlayableEnvironmentError, ShotError

from .. import playables
from ..framing.readiness import edits_of
from ..polls import has_environment, not_rendering
from ..scene_bridge import action_names, frames_per_second, playable_objects
from ..worker import questions
from ..worker.session import session
from ..worker.worker_operator import Result, Task, WorkerOperator, model_path
from .action_keys import delete_key_at, keyed_frames
from .clip_actions import Box, ClipFrame, PictureFeed, ReadActions, State, read_actions, step_frames
from .clip_reading import ClipSource, covering_strip, tracked_names

SOURCES = (
    ("STRIP", "Strip", "The active movie or image strip, or the topmost one, that shows all along"),
    ("CLIP", "Movie Clip", "The movie clip with the tracking markers"),
)


class WorkerObserver:
    """The worker, asked about the pictures of a clip.

    Args:
        model: Whose states and actions are meant.
        names: The objects to be found.
    """

    def __init__(self, model: str, names: Sequence[str]) -> None:
        self._model, self._names = model, names

    def detect(self, pixels: np.ndarray, should_stop: Callable) -> Mapping[str, Box]:
        """Boxes of the objects in a picture."""
        return questions.detect(session, self._model, pixels, self._names, should_stop).boxes

    def encode(self, seen: ClipFrame, boxes: Mapping[str, Box], should_stop: Callable) -> State:
        """The state that a picture shows."""
        return session.encode(self._model, seen.pixels, seen.camera, boxes, should_stop)

    def infer(
        self, states: Sequence[State], cameras: Sequence[Camera], should_stop: Callable
    ) -> Mapping[str, Sequence[int]]:
        """By object the actions that lead from each state to the next."""
        return questions.infer_actions(session, self._model, states, cameras, should_stop)


class PLAYABLE_OT_actions_from_clip(WorkerOperator, bpy.types.Operator):
    """Find out what the players of a clip do, step by step, and key it; other keys there go"""

    bl_idname = "playable.actions_from_clip"
    bl_label = "Actions from Clip"
    bl_options = {"UNDO"}

    source: EnumProperty(name="From", description="Where the pictures come from", items=SOURCES)

    _feed: PictureFeed | None = None
    _unread: Iterator[int] = iter(())

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return has_environment(cls, context.scene) and not_rendering(cls)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        # Blender's main thread reads the pictures while another one looks at them.
        self._feed = PictureFeed()
        return super().invoke(context, event)

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> Result:
        while event.type == "TIMER" and self._feed is not None and self._feed.has_room:
            self._read_on()
        return super().modal(context, event)

    def task(self, context: bpy.types.Context) -> Task:
        scene = context.scene
        settings, name = scene.playable_environment, scene.name
        players = [n for n, each in playable_objects(scene).items() if action_names(each)]
        if not players:
            raise ShotError("the model has no actions for any playable object of this scene")
        pace = frames_per_second(scene) / settings.steps_per_second
        frames = step_frames(scene.frame_start, scene.frame_end, pace)
        self._clip, self._unread = self._find(context, frames, players), iter(frames)
        observer, feed = WorkerObserver(model_path(settings.model), players), self._feed

        def work(should_stop: Callable, on_progress: Callable) -> ReadActions:
            pictures = self._read_all() if feed is None else feed.pictures(should_stop)
            progress = should_stop, on_progress, len(frames)
            return read_actions(pictures, players, observer, *progress)

        return Task(work, lambda found: key_clip(bpy.data.scenes[name], found, frames))

    def _find(
        self, context: bpy.types.Context, frames: Sequence[int], players: Sequence[str]
    ) -> ClipSource:
        scene, framing = context.scene, context.scene.playable_environment.framing
        tracked, facts = tracked_names(scene, players), framing.facts
        if tracked is None and facts is not None and not facts.detects:
            raise ShotError(
                "nobody knows where the players are in each picture: the runtime has no detector; "
                "track them in a movie clip and name the tracks under Objects in Environment"
            )
        if self.source == "STRIP":
            edit, strip = covering_strip(edits_of(context), frames)
            return ClipSource(scene.name, edit.name, strip.name, tracked)
        if framing.clip is None:
            raise ShotError("no movie clip is chosen; choose one under Objects in Environment")
        return ClipSource(scene.name, "", framing.clip.name, tracked)

    def _read_all(self) -> Iterator[ClipFrame]:
        for frame in self._unread:
            yield self._clip.picture_at(frame)

    def _read_on(self) -> None:
        frame = next(self._unread, None)
        try:
            self._feed.give(None if frame is None else self._clip.picture_at(frame))
        except (PlayableEnvironmentError, KeyError) as error:
            # KeyError: the scene, the strip or the clip has been removed meanwhile.
            reason = (
                error
                if isinstance(error, PlayableEnvironmentError)
                else ShotError(f"{error} is gone; the clip cannot be read on")
            )
            self._feed.give(reason)


def key_clip(scene: bpy.types.Scene, found: ReadActions, frames: Sequence[int]) -> str:
    """Replace the action keys of a range by those that were read; what was done, in words."""
    count = 0
    for name, each in playable_objects(scene).items():
        keys = found.keys.get(name)
        if not keys:
            continue
        for frame in keyed_frames(each):
            if frames[0] <= frame < frames[-1]:
                delete_key_at(each, frame)
        for frame, action in keys:
            playables.key_action(each, frame, action)
        count += len(keys)
    scene.frame_set(scene.frame_current, subframe=scene.frame_subframe)
    gaps = [f"{name} was not seen in {n} pictures" for name, n in found.filled.items()]
    return "; ".join([f"{count} action keys over {len(frames) - 1} steps", *gaps])


CLASSES = (PLAYABLE_OT_actions_from_clip,)

register, unregister = bpy.utils.register_classes_factory(CLASSES)
