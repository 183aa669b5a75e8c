"""Ctrl-C between pieces of work."""

import importlib
import signal
import sys
import threading

import pytest

from wiperjax.machine.interrupt import heeded


def test_a_handler_of_somebody_elses_is_left_alone():
    """It may end the program in its own way: nothing is raised in its place."""
    heard = []
    before = signal.signal(signal.SIGINT, lambda *_: heard.append(1))
    try:
        with heeded() as check:
            signal.raise_signal(signal.SIGINT)
            check()
    finally:
        signal.signal(signal.SIGINT, before)
    assert heard == [1]


@pytest.fixture
def pythons_own():
    """Python's own handler, which a process of the tests may lack."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_a_statement_inside_another_hears_what_that_heard(pythons_own):
    with heeded(), heeded() as check:
        check()
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            check()


def test_in_another_thread_nothing_is_heard(pythons_own):
    raised = []

    def work():
        with heeded() as check:
            try:
                check()
            except KeyboardInterrupt as stop:
                raised.append(stop)

    with heeded():
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        thread = threading.Thread(target=work)
        thread.start()
        thread.join()
    assert not raised


def test_a_module_that_is_being_imported_is_imported_first(tmp_path, monkeypatch, pythons_own):
    """Compiled modules crashed: three of 45 Ctrl-C in the first two seconds of a sweep."""
    text = "import signal\nsignal.raise_signal(signal.SIGINT)\nwhole = True\n"
    (tmp_path / "pressed_meanwhile.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    with heeded() as check:
        assert importlib.import_module("pressed_meanwhile").whole
        with pytest.raises(KeyboardInterrupt):
            check()
    monkeypatch.delitem(sys.modules, "pressed_meanwhile")
    with heeded(), pytest.raises(KeyboardInterrupt):  # a second time is not waited for
        importlib.import_module("pressed_meanwhile")
        monkeypatch.delitem(sys.modules, "pressed_meanwhile")
        importlib.import_module("pressed_meanwhile")
