"""The worker's loop: one request after the other, each with exactly one terminal reply."""

import queue
import sys
import threading
import traceback
from collections.abc import Callable
from io import BufferedIOBase

from pe_runtime.contract.errors import PlayableEnvironmentError, WorkerError
from pe_runtime.contract.messages import CANCELLED, Message, failure, read_message, write_message
from pe_runtime.worker.conversation import Call, Conversation, RequestCancelledError
from pe_runtime.worker.world import World


class Inbox:
    """Requests in order of arrival; a thread reads on while one is being answered.

    `cancel` reaches every request that came before it and none that comes after.
    """

    def __init__(self, source: BufferedIOBase) -> None:
        self._source = source
        self._waiting: queue.SimpleQueue[tuple[int, Message | WorkerError | None]]
        self._waiting = queue.SimpleQueue()
        self._received = 0
        self._cancelled = 0
        threading.Thread(target=self._read, name="wire reader", daemon=True).start()

    def next(self) -> tuple[int, Message | None]:
        """The next request and its number; None after `stop` or at the end of the stream.

        Raises:
            WorkerError: What came is not a message.
        """
        number, message = self._waiting.get()
        if isinstance(message, WorkerError):
            raise message
        return number, message

    def is_cancelled(self, number: int) -> bool:
        """Whether a `cancel` or `stop` came after this request."""
        return number <= self._cancelled

    def _read(self) -> None:
        message: Message | WorkerError | None = None
        while True:
            try:
                message = read_message(self._source)
            except WorkerError as error:
                message = error
            if isinstance(message, Message) and message.type in ("cancel", "stop"):
                self._cancelled = self._received
                if message.type == "cancel":
                    continue
                message = None
            self._received += 1
            self._waiting.put((self._received, message))
            if not isinstance(message, Message):
                return


def serve(make_world: Callable[[], World], inbox: Inbox, sink: BufferedIOBase) -> int:
    """Answer requests until `stop` or the end of the stream.

    Returns:
        Exit code: 0 at a clean end, 1 after bytes that are no message.
    """
    conversation = Conversation(make_world)
    while True:
        try:
            number, request = inbox.next()
        except WorkerError as error:
            # Where the next message begins is unknown now: say so and end.
            write_message(sink, failure("WorkerError", str(error)))
            return 1
        if request is None:
            return 0
        write_message(sink, _reply(conversation, number, request, inbox, sink))


def _reply(
    conversation: Conversation, number: int, request: Message, inbox: Inbox, sink: BufferedIOBase
) -> Message:
    """The terminal reply of one request, whatever happens inside."""
    call = Call(
        request.fields,
        request.buffers,
        send=lambda message: write_message(sink, message),
        is_cancelled=lambda: inbox.is_cancelled(number),
    )
    try:
        if call.is_cancelled():
            raise RequestCancelledError("cancelled before it began")
        return conversation.answer(request, call)
    except RequestCancelledError as stop:
        return failure(CANCELLED, str(stop))
    except PlayableEnvironmentError as error:
        if isinstance(error, WorkerError):
            traceback.print_exc(file=sys.stderr)
        return failure(type(error).__name__, str(error))
    except BrokenPipeError:
        raise
    except Exception as error:  # noqa: BLE001 a request without a reply would hang Blender
        traceback.print_exc(file=sys.stderr)
        return failure(type(error).__name__, f"{error} (a bug; the worker's log has more)")
