"""Draws what lies on a desk until nothing is left, in a thread of its own. No `bpy` here."""

from pe_runtime.contract.errors import PlayableEnvironmentError

from ..worker.background import BackgroundCall
from ..worker.replies import WorkerCancelledError
from ..worker.session import Session
from .desk import Desk, Job

STOPPED_MESSAGE = (
    "the runtime was stopped; leave Rendered shading and come back to it to start it again"
)


class Drawer:
    """Has the worker draw for a desk; one thread at a time, and none when all is drawn.

    Args:
        desk: Where jobs come from and pictures go.
        session: Whose worker draws; it is left to others whenever they want it.
    """

    def __init__(self, desk: Desk, session: Session) -> None:
        self._desk, self._session = desk, session
        self._call: BackgroundCall | None = None

    @property
    def works(self) -> bool:
        """Whether a thread draws just now."""
        return self._call is not None and not self._call.done

    def go_on(self) -> None:
        """Draw what there is to draw, if nobody does yet."""
        if not self.works and (job := self._desk.take_job()) is not None:
            self._call = BackgroundCall(lambda *_: self._draw_all(job))

    def wait(self) -> None:
        """Until the thread has ended."""
        if self._call is not None:
            self._call.result()

    def _draw_all(self, job: Job | None) -> None:
        while job is not None and self._draw(job):
            job = self._desk.take_job()

    def _draw(self, job: Job) -> bool:
        """Draw one picture; whether to go on at once."""
        desk, frame = self._desk, job.wish.take.frame_start
        times_closed = self._session.times_closed
        try:
            drawn = self._session.render(
                job.shot, frame, lambda: desk.is_outdated(job), job.wish.whole, True
            )
        except WorkerCancelledError:
            stopped = self._session.times_closed > times_closed
            desk.give_up(job, STOPPED_MESSAGE if stopped else "")
            return desk.is_outdated(job)
        except PlayableEnvironmentError as error:
            desk.give_up(job, str(error))
            return False
        # A thread has nobody to tell: the viewport does.
        except Exception as error:  # noqa: BLE001
            desk.give_up(job, f"{type(error).__name__}: {error}")
            return False
        desk.deliver(job, drawn.rgb, drawn.seconds)
        return True
