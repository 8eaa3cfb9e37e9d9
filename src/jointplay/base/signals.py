"""Requests to stop: Ctrl-C, SIGTERM and SIGHUP all do the same; a second one discards.

After the first request what was computed is saved, and a file being written is finished. The second
discards what is not yet saved, and says so.
"""

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import SimpleNamespace
from typing import Any

INTERRUPTED = 130
"""Exit status after a request to stop."""

SAVED = "stop requested after the computation had ended: the result is saved"
"""Message for a request that comes too late to stop anything."""

SIGNALS = tuple(
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
)
"""Signals that request to stop, as far as the system has them."""

_AGAIN_S = 0.01
"""Delay after which a request that Python dropped is repeated [s]."""


class GivenUp(KeyboardInterrupt):
    """A second request to stop came before all was saved; the message says what is lost."""


_state = SimpleNamespace(requests=0, keeping="")
"""Number of requests to stop this process, and the label of what is to be saved, if anything."""


@contextmanager
def listening() -> Iterator[None]:
    """Treat SIGTERM and SIGHUP like Ctrl-C within the block, and count the requests."""
    if threading.current_thread() is not threading.main_thread():
        yield  # only the main thread can listen
        return
    before = {number: signal.getsignal(number) for number in SIGNALS}
    ignored = {n for n, handler in before.items() if handler is signal.SIG_IGN}  # such as by nohup
    for number in set(SIGNALS) - ignored:
        signal.signal(number, _handle)
    hook = sys.unraisablehook

    def lost(about: Any) -> None:
        """Repeat a request that Python dropped, as it does in destructors and weakref callbacks."""
        if not issubclass(about.exc_type, KeyboardInterrupt):
            hook(about)
            return
        _state.requests -= 1
        main = threading.main_thread().ident
        later = threading.Timer(_AGAIN_S, signal.pthread_kill, [main, signal.SIGINT])
        later.daemon = True
        later.start()

    sys.unraisablehook = lost
    _state.requests = 0
    try:
        yield
    finally:
        sys.unraisablehook = hook
        for number, handler in before.items():
            signal.signal(number, handler if handler is not None else signal.SIG_DFL)
        _state.requests = 0


def forget() -> None:
    """Reset the state after a fork: the parent's requests, and what it was to save."""
    _state.requests, _state.keeping = 0, ""


def _handle(*_: Any) -> None:
    stop()
    say(f"stopping; saving {_state.keeping} (interrupt again to discard it)")


def stop(*_: Any) -> None:
    """Count a request, and raise unless there is something to save first."""
    _state.requests += 1
    if not _state.keeping:
        raise KeyboardInterrupt
    if _state.requests > 1:
        raise GivenUp(f"gave up {_state.keeping}")


def say(text: str) -> None:
    """Log a note as "jointplay", or print it to standard error where no logger listens.

    It starts on a new line, as a progress bar may be there.
    """
    import logging  # seldom needed

    logger = logging.getLogger("jointplay")
    if logger.hasHandlers():
        logger.warning(text)
        return
    with suppress(OSError, ValueError, AttributeError):  # standard error is closed, full, or absent
        try:
            sys.stderr.write(f"\n{text}\n")
            sys.stderr.flush()
        except RuntimeError:  # a signal came while a bar was being written
            os.write(sys.__stderr__.fileno() if sys.__stderr__ else 2, f"\n{text}\n".encode())


@contextmanager
def keeping(label: str) -> Iterator[None]:
    """Protect the block, which computes and saves `label`, from a single request to stop.

    Check `stop_requested` afterwards.

    Raises:
        GivenUp: two requests to stop, or one before there was anything to save.
    """
    outer = _state.keeping
    _state.keeping = label
    try:
        yield
    except GivenUp:
        raise
    except KeyboardInterrupt:
        early = _state.requests == 1
        raise GivenUp(
            f"nothing of {label} was computed yet" if early else f"gave up {label}"
        ) from None
    finally:
        _state.keeping = outer


def stop_requested() -> bool:
    """Whether this process has been asked to stop."""
    return bool(_state.requests)
