"""Ctrl-C between pieces of work."""

import importlib
import signal
import sys
import threading

import pytest
from processes import drop_ctrl_c

from wiperjax.machine.files import replacing
from wiperjax.machine.interrupt import deaf, end_as_by_ctrl_c, heeded


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


def test_what_python_drops_is_told_by_no_traceback(pythons_own, monkeypatch):
    """One in a heap of tests' runs was pressed in the callback of a weak reference."""
    told = []
    monkeypatch.setattr(sys, "unraisablehook", told.append)
    with heeded() as check, pytest.raises(KeyboardInterrupt):
        drop_ctrl_c()
        assert not told
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


def test_who_insists_hears_it_when_the_import_is_done(tmp_path, monkeypatch, pythons_own):
    """Of 40 Ctrl-C while `verify` began one crashed it, and one was dropped."""
    pressed = "import signal\nsignal.raise_signal(signal.SIGINT)\nwhole = True\n"
    (tmp_path / "pressed_inside.py").write_text(pressed)
    (tmp_path / "around_it.py").write_text("import pressed_inside\nwhole = pressed_inside.whole\n")
    monkeypatch.syspath_prepend(tmp_path)
    profiler = sys.getprofile()
    with heeded(insists=True), pytest.raises(KeyboardInterrupt):
        with heeded():
            importlib.import_module("around_it")
    assert sys.modules["around_it"].whole and sys.getprofile() is profiler
    for name in ("around_it", "pressed_inside"):
        monkeypatch.delitem(sys.modules, name)


def test_who_insists_hears_what_python_drops(pythons_own):
    """Of 40 SIGTERM while `verify` began one was dropped by the callback of a weak reference."""
    hook, after = sys.unraisablehook, []
    with heeded(insists=True), pytest.raises(KeyboardInterrupt):
        drop_ctrl_c()
        after.append(len(after))
    assert not after and sys.unraisablehook is hook


@pytest.fixture
def ending(pythons_own):
    """As in a process of ours: what ends it is heard."""
    names = [name for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    before = {number: signal.getsignal(number) for number in map(signal.Signals.__getitem__, names)}
    for number in before:
        signal.signal(number, signal.SIG_DFL)
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.parametrize("ignored", [False, True])  # as in a shell's background
def test_what_ends_a_process_leaves_no_file_under_a_temporary_name(ending, ignored, tmp_path):
    ended = end_as_by_ctrl_c()
    assert [ended(status) for status in (0, 1, 130)] == [0, 1, 130]
    if ignored:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    with pytest.raises(KeyboardInterrupt), replacing(tmp_path / "a.png") as temporary:
        temporary.write_text("half")
        signal.raise_signal(signal.SIGTERM)
    assert list(tmp_path.iterdir()) == []
    assert [ended(status) for status in (0, 1, 130)] == [0, 143, 143]
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL  # a second one is not waited for


def test_what_ends_a_process_waits_where_a_ctrl_c_does(ending):
    end_as_by_ctrl_c()
    with heeded(), pytest.raises(KeyboardInterrupt), deaf():
        signal.raise_signal(signal.SIGTERM)
        waited = True
    assert waited


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="there is no SIGHUP")
def test_what_is_ignored_stays_so(ending):
    signal.signal(signal.SIGHUP, signal.SIG_IGN)  # by nohup
    end_as_by_ctrl_c()
    signal.raise_signal(signal.SIGHUP)
