"""Paths that follow their keys: sampled in slices, predicted in a thread, keyed on their return.

Everything happens in `tick`, which the main thread calls again and again. Scenes are kept by name,
so that undo, deletion and other files do no harm; what is in the scene decides, never what was
remembered of it.
"""

from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from time import perf_counter

import bpy

from pe_runtime.contract.errors import PlayableEnvironmentError, ShotError

from .. import playables
from ..bake import Bake, bake_of
from ..keyed_paths import baked_from, continue_bake
from ..scene_bridge import Moment, shot_from_moments
from ..worker.background import BackgroundCall
from ..worker.replies import PredictedPaths, WorkerCancelledError
from ..worker.worker_operator import model_path
from .same_shot import first_difference
from .signature import Signature, signature_of
from .stand_in import moment_at, stand_in_for
from .stepping import step_actions

QUIET_SECONDS = 0.3
AGAIN_SECONDS = 1.0
"""How long after it had to make way a prediction is tried again."""
SLICE_SECONDS, LONGEST_SLICE, SHARE = 0.015, 0.25, 0.25
"""Seconds of sampling in a tick; where Blender takes long between ticks, a share of that time."""
REMEMBERED = 4
BUSY, WAITING, IDLE = 0.02, 0.1, 0.4
"""Seconds until the next tick."""
UPDATING = "Updating the paths"
Predict = Callable[..., PredictedPaths]


@dataclass(frozen=True)
class Known:
    """What a bake was made from.

    Attributes:
        signature: Of the scene.
        moments: The sampled frames.
    """

    signature: Signature
    moments: Sequence[Moment]


@dataclass
class _Job:
    """One update on its way.

    Attributes:
        scene: Its scene's name.
        signature: Of the scene when it began.
        since: First frame that may have changed.
        moments: The frames that are known so far.
        bake: What was baked when it began, as a text.
        call: The prediction; None while frames are sampled.
    """

    scene: str
    signature: Signature
    since: int
    moments: list[Moment]
    bake: str
    call: BackgroundCall | None = field(default=None)


class LivePaths:
    """Keeps the baked paths of all scenes up to date.

    Args:
        predict: Asks the worker, as `Session.rollout` does.
    """

    def __init__(self, predict: Predict) -> None:
        self._predict = predict
        self.forget()

    def forget(self) -> None:
        """Give up what is under way and remember nothing, as for another file."""
        job = getattr(self, "_job", None)
        if job is not None and job.call is not None:
            job.call.cancel()
        self._job: _Job | None = None
        self._known: OrderedDict[str, Known] = OrderedDict()
        self._failures: dict[str, tuple[Signature, str]] = {}
        self._ranges: dict[str, tuple] = {}
        self._quiet_from: float | None = None
        self._touched, self._ticked_at, self._slice = False, 0.0, SLICE_SECONDS

    def touch(self) -> None:
        """Note that anything may have changed; may be called from any thread."""
        self._touched = True

    def note(self, scene: bpy.types.Scene) -> str:
        """What there is to say about a scene's paths: nothing, what is done, what went wrong."""
        if self._job is not None and self._job.scene == scene.name:
            return UPDATING
        _, reason = self._failures.get(scene.name, (None, ""))
        return reason

    def remember(
        self, scene: bpy.types.Scene, signature: Signature, moments: Sequence[Moment]
    ) -> None:
        """Note what the bake that a scene has now was made from."""
        self._failures.pop(scene.name, None)
        self._known[_bake_text(scene)] = Known(signature, moments)
        while len(self._known) > REMEMBERED:
            self._known.popitem(last=False)

    def tick(self, now: float) -> float:
        """Do a little of what there is to do; the seconds until the next tick.

        Args:
            now: Seconds of any steady clock.
        """
        elapsed, self._ticked_at = now - self._ticked_at, now
        self._slice = min(max(SLICE_SECONDS, SHARE * elapsed), LONGEST_SLICE)
        if self._touched or self._ranges_changed():
            self._touched, self._quiet_from = False, now
            self._drop_outdated()
        if self._job is not None:
            self._go_on(now)
            return BUSY
        if self._quiet_from is None:
            return IDLE
        if now - self._quiet_from < QUIET_SECONDS:
            return WAITING
        self._job = self._next_job()
        if self._job is None:
            self._quiet_from = None
            return IDLE
        return BUSY

    def _ranges_changed(self) -> bool:
        # Blender tells nobody when a range or the pace changes.
        found = {
            scene.name: (
                scene.frame_start,
                scene.frame_end,
                scene.render.fps,
                scene.render.fps_base,
            )
            for scene in bpy.data.scenes
            if _is_live(scene)
        }
        before, self._ranges = self._ranges, found
        return any(found[name] != before[name] for name in found.keys() & before.keys())

    def _drop_outdated(self) -> None:
        """End a job whose scene is no longer what it was sampled from."""
        if self._job is not None and self._outdated(self._job):
            self._drop()

    def _outdated(self, job: _Job) -> bool:
        scene = bpy.data.scenes.get(job.scene)
        if scene is None or not _is_live(scene) or _bake_text(scene) != job.bake:
            return True
        return job.signature.first_change(signature_of(scene)) is not None

    def _drop(self) -> None:
        if self._job.call is not None:
            self._job.call.cancel()
        self._job = None

    def _next_job(self) -> _Job | None:
        for scene in bpy.data.scenes:
            if scene.playable_environment.root is not None:
                step_actions(scene)
            if not _is_live(scene):
                self._failures.pop(scene.name, None)
                continue
            job = self._job_for(scene)
            if job is not None:
                return job
        return None

    def _job_for(self, scene: bpy.types.Scene) -> _Job | None:
        """What has to be done about a scene; None if its paths are those of its keys."""
        signature, text = signature_of(scene), _bake_text(scene)
        failed, _ = self._failures.get(scene.name, (None, ""))
        if failed is not None and failed.first_change(signature) is None:
            return None
        known = self._known.get(text)
        if known is None:
            return _Job(scene.name, signature, signature.start, [], text)
        since = known.signature.first_change(signature)
        if since is None:
            self._failures.pop(scene.name, None)
            return None
        since = min(since, signature.start + len(known.moments))
        head = list(known.moments[: since - signature.start])
        return _Job(scene.name, signature, since, head, text)

    def _go_on(self, now: float) -> None:
        job = self._job
        scene = bpy.data.scenes.get(job.scene)
        if scene is None:
            self._drop()
            return
        try:
            if job.call is None:
                self._sample(scene, job)
            elif job.call.done:
                self._finish(scene, job)
        except WorkerCancelledError:
            # Somebody else wanted the worker; their turn is over soon.
            self._job, self._quiet_from = None, now + AGAIN_SECONDS
        except PlayableEnvironmentError as error:
            self._fail(job, str(error))
        # A timer that raises is never called again.
        except Exception as error:  # noqa: BLE001
            self._fail(job, f"{type(error).__name__}: {error}")

    def _fail(self, job: _Job, reason: str) -> None:
        self._failures[job.scene] = job.signature, reason
        self._job = None

    def _sample(self, scene: bpy.types.Scene, job: _Job) -> None:
        """Sample some frames; with the last one, ask for the paths."""
        until, moments = perf_counter() + self._slice, job.moments
        last = job.signature.end
        with stand_in_for(scene) as stand_in:
            while job.signature.start + len(moments) <= last and perf_counter() < until:
                moments.append(moment_at(stand_in, job.signature.start + len(moments)))
        del moments[max(0, last - job.signature.start + 1) :]
        if job.signature.start + len(moments) <= last:
            return
        settings = scene.playable_environment
        start = playables.stored_start(settings)
        shot = shot_from_moments(scene, start, model_path(settings.model), moments)
        bake = _bake_or_none(scene)
        changed = shot.frame_start if bake is None else first_difference(bake.shot, shot)
        if changed is None:
            self.remember(scene, job.signature, moments)
            self._job = None
            return
        job.since = max(job.since, changed)
        predict = self._predict

        def work(should_stop: Callable, on_progress: Callable) -> Bake:
            paths = predict(shot, should_stop, on_progress, yielding=True)
            return baked_from(shot, paths)

        job.call = BackgroundCall(work)

    def _finish(self, scene: bpy.types.Scene, job: _Job) -> None:
        made = job.call.result()
        self._job = None
        if self._outdated(job):
            self.touch()
            return
        continue_bake(scene, _bake_or_none(scene), made, job.moments, job.since)
        self.remember(scene, job.signature, job.moments)


def _is_live(scene: bpy.types.Scene) -> bool:
    settings = scene.playable_environment
    has_all = settings.root is not None and settings.state_text is not None
    return has_all and settings.playing.update_paths and scene.is_editable


def _bake_text(scene: bpy.types.Scene) -> str:
    text = scene.playable_environment.bake_text
    return "" if text is None else text.as_string()


def _bake_or_none(scene: bpy.types.Scene) -> Bake | None:
    try:
        return bake_of(scene.playable_environment)
    except ShotError:
        return None
