"""How a run ends when it is asked to: after the step that it is in, saved."""

import contextlib
import signal
import threading
from collections.abc import Iterator


@contextlib.contextmanager
def finishing_on_signal() -> Iterator[threading.Event]:
    """Turn Ctrl-C and SIGTERM into a wish to stop after the current step; twice means at once.

    A step that is broken off in the middle would leave weights that no resumed run can repeat.
    Only the main thread may handle signals; elsewhere the event is simply never set.
    """
    wish = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield wish
        return
    signals = (signal.SIGINT, signal.SIGTERM)
    before = {number: signal.getsignal(number) for number in signals}
    seen: set[int] = set()

    def remember(number: int, frame: object) -> None:
        # One of each is still one wish: at Ctrl-C torchrun adds a SIGTERM of its own.
        if number in seen:
            raise KeyboardInterrupt
        seen.add(number)
        wish.set()

    for number in signals:
        signal.signal(number, remember)
    try:
        yield wish
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
