"""Requests to stop, whenever they come."""

import signal
import subprocess
import sys
import time
import weakref

import pytest

from jointplay.base import signals


class Something:
    """Of which there can be weak references."""


def _forget_and_wait(things):
    things.clear()
    for _ in range(500):
        time.sleep(0.01)


def test_a_request_that_comes_in_a_callback_whose_exceptions_python_drops_is_made_again():
    things = [Something()]
    callback = weakref.ref(things[0], lambda _: signal.raise_signal(signal.SIGINT))
    with signals.listening():
        with pytest.raises(KeyboardInterrupt):
            _forget_and_wait(things)
        assert signals.stop_requested()
    assert callback() is None


def test_what_else_is_dropped_is_reported_as_before(monkeypatch):
    seen = []
    monkeypatch.setattr("sys.unraisablehook", seen.append)
    thing = Something()
    callback = weakref.ref(thing, lambda _: 1 / 0)
    with signals.listening():
        del thing
    assert callback() is None
    assert [one.exc_type for one in seen] == [ZeroDivisionError]


def test_notes_are_logged_where_somebody_listens_and_else_written_to_standard_error(caplog):
    signals.say("kept")
    assert [record.getMessage() for record in caplog.records] == ["kept"]
    assert caplog.records[0].name == "jointplay"
    code = "from jointplay.base import signals; signals.say('kept')"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert (said.stdout, said.stderr) == ("", "\nkept\n")
