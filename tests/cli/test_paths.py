"""What a path may lead to: whatever stands there is seen before any work, and nothing is lost.

The engine is the stub of `stub_sweep`. What used to hang is stopped by an alarm.
"""

import dataclasses
import errno
import os
import resource
import signal
import socket
import stat
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from stub_sweep import BLOCK, evaluate, half_done, make_spec, run

from wiperjax.cli import main
from wiperjax.cli.options import command_line
from wiperjax.machine import files
from wiperjax.machine.files import StoreError, check_output
from wiperjax.maps import compare_rungs, driver
from wiperjax.maps.verify import verify
from wiperjax.plots import plot_file
from wiperjax.sound import Sound
from wiperjax.specs.load import SpecError, load_scene, load_sweep
from wiperjax.store import whole
from wiperjax.store.blocks import BlockStore
from wiperjax.store.manifest import parts_of
from wiperjax.store.whole import open_map

SWEEP = """
[axes]
attack_angle = { start = -40, stop = 40, num = 7 }
normal_load = { start = 5, stop = 30, num = 5 }
belt_speed = { start = 0.02, stop = 1.0, num = 11, spacing = "geometric" }
[run]
transient = 0.2
window = 0.2
samples = 512
"""


@pytest.fixture(autouse=True)
def alarm():
    """A test that hangs fails."""

    def ring(*_):
        raise TimeoutError("it hangs")

    before = signal.signal(signal.SIGALRM, ring)
    signal.alarm(60)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


def computed_by(monkeypatch, stub):
    """A stub in place of the engine, in sweeps and where they are verified."""
    for module in ("computing", "verify"):
        monkeypatch.setattr(f"wiperjax.maps.{module}.engine", lambda: (stub, {}))


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    computed_by(monkeypatch, evaluate)
    Path("s.toml").write_text(SWEEP)
    return tmp_path


def said(capsys, words):
    """The one line that a refused command prints."""
    assert main(words.split() if isinstance(words, str) else words) == 1
    printed = capsys.readouterr().err
    assert printed.count("\n") == 1 and printed.startswith("wiperjax: ")
    return printed.removeprefix("wiperjax: ").strip()


# --- pipes, sockets, devices ----------------------------------------------------------------------


def pipe(path):
    os.mkfifo(path)


def bound_socket(path):
    with socket.socket(socket.AF_UNIX) as end:
        end.bind(str(path))


def device(path):
    os.symlink("/dev/zero", path)


KINDS = {"a pipe": pipe, "a socket": bound_socket, "a device": device, "a folder": Path.mkdir}


@pytest.mark.parametrize("kind", KINDS)
def test_files_to_read_are_regular(kind, folder, capsys):
    odd = Path("odd.toml")
    KINDS[kind](odd)
    for load in (load_sweep, load_scene, lambda path: driver.sweep(path, progress=False)):
        with pytest.raises(SpecError) as refused:
            load(odd)
        assert str(refused.value) == f"odd.toml: cannot be read: it is {kind}, and no regular file"
    assert said(capsys, "sweep odd.toml -o m.h5").endswith(f"it is {kind}, and no regular file")
    if kind == "a folder":  # may be that of an unfinished sweep
        return
    for look in (open_map, verify, lambda path: plot_file(path, "p.png")):
        with pytest.raises(StoreError) as refused:
            look(odd)
        assert str(refused.value) == f"odd.toml: cannot be read: it is {kind}, and no regular file"
    for words in ("info odd.toml", "plot odd.toml -o p.png", "listen odd.toml -o p.wav"):
        assert said(capsys, words) == f"odd.toml: cannot be read: it is {kind}, and no regular file"
    assert said(capsys, "verify odd.toml").endswith("no regular file")


def kept(path):
    """What a thing in a folder is; when it was read last may change: looking follows a link."""
    stat = os.lstat(path)
    return stat.st_mode, stat.st_ino, stat.st_size, stat.st_mtime_ns, stat.st_ctime_ns


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("how", [{}, {"force": True}, {"resume": True}])
def test_output_is_a_regular_file(kind, how, folder, capsys):
    KINDS[kind]("odd.h5")
    before = kept("odd.h5")
    with pytest.raises(StoreError, match=f"^odd.h5: cannot be written: it is {kind}|it is a link"):
        run(make_spec(), "odd.h5", evaluate=pytest.fail, **how)
    flags = [f"--{name}" for name in how]
    line = said(capsys, ["sweep", "s.toml", "-o", "odd.h5", "--no-picture", *flags])
    assert line.startswith("odd.h5: cannot be written: it is a")
    assert kept("odd.h5") == before and not Path("odd.h5.parts").exists()
    with pytest.raises(StoreError, match="cannot be written"):
        whole.write_dataset(xr.Dataset(), "odd.h5", force=True)
    with pytest.raises(StoreError, match="cannot be written"):
        Sound(np.zeros(9), "velocity", 1.0, "m/s").write("odd.h5", force=True)


def test_pipes_among_the_blocks(folder):
    spec = make_spec()
    half_done("m.h5", spec, 3)
    parts = parts_of("m.h5")
    block = next(parts.glob("block-00000001-*"))
    block.unlink()
    pipe(block)
    with run(spec, "m.h5", resume=True) as ds:  # computed again
        assert ds.sizes["attack_angle"] == 7
    half_done("n.h5", spec, 3)
    manifest = parts_of("n.h5") / "manifest.json"
    manifest.unlink()
    pipe(manifest)
    with pytest.raises(StoreError, match="manifest.json: .*it is a pipe, and no regular file"):
        run(spec, "n.h5", resume=True, evaluate=pytest.fail)


# --- what stands where a file is to be made -------------------------------------------------------


def made(path, content=b"precious"):
    Path(path).write_bytes(content)
    return path


def test_links_are_not_written_through(folder):
    """Renaming replaces the link, not what it leads to: neither would be what was meant."""
    made("there.h5")
    os.symlink("there.h5", "link.h5")
    os.symlink("nowhere.h5", "broken.h5")
    for name, target in (("link.h5", "there.h5"), ("broken.h5", "nowhere.h5")):
        for force in (False, True):
            with pytest.raises(StoreError) as refused:
                run(make_spec(), name, force=force, evaluate=pytest.fail)
            assert str(refused.value) == (
                f"{name}: cannot be written: it is a link to {target}; name that file itself"
            )
    assert Path("there.h5").read_bytes() == b"precious" and not Path("nowhere.h5").exists()


def test_the_input_is_not_the_output(folder, capsys):
    Path("s.toml").rename("s.h5")
    os.link("s.h5", "hard.h5")
    Path("sub").mkdir()
    os.symlink(folder, "sub/up")
    for name in ("s.h5", "./s.h5", "hard.h5", "sub/up/s.h5"):
        with pytest.raises(StoreError, match="must be another file than the input$"):
            driver.sweep("s.h5", name, force=True, progress=False)
        assert "must be another file than the input" in said(
            capsys, f"sweep s.h5 -o {name} --force"
        )
    assert Path("s.h5").read_text() == SWEEP
    run(make_spec(), "m.h5").close()
    os.link("m.h5", "m.png")
    with pytest.raises(StoreError, match="m.png: must be another file than the input$"):
        plot_file("m.h5", "m.png", force=True)


def test_no_scene_of_a_ladder_is_its_output(folder, capsys):
    for name in ("a.toml", "b.md"):
        Path(name).write_text("[run]\nduration = 0.1\n")
    line = said(capsys, "ladder a.toml b.md -o b.md --force")
    assert line == "b.md: must be another file than the input"
    assert Path("b.md").read_text().startswith("[run]")


def test_a_table_that_cannot_be_written_leaves_the_old_one(folder, capsys, monkeypatch):
    """The old one was lost, and the line did not name it."""
    Path("a.toml").write_text("[belt]\nspeed = 0.3\n[run]\nduration = 0.1\n")
    Path("t.md").write_text("old")
    lip = compare_rungs.Rung("a", "lip", "squeal", "stick_slip", "none", 700.0, 0.4, np.nan, 9)
    monkeypatch.setattr(compare_rungs, "compare", lambda path, say: [lip])
    monkeypatch.setattr(sys, "argv", "wiperjax ladder a.toml -o t.md --force".split())
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, before[1]))
    try:
        line = said(capsys, "ladder a.toml -o t.md --force")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert line == "t.md: cannot be written: File too large"
    assert Path("t.md").read_text() == "old" and not list(Path().glob("*.tmp"))
    assert main("ladder a.toml -o t.md --force".split()) == 0
    text = Path("t.md").read_text()
    assert "\nMade by `wiperjax ladder a.toml -o t.md --force`, " in text
    assert "](" not in text  # it lies anywhere: a link would lead nowhere

    odd = dataclasses.replace(lip, scene=os.fsdecode(b"a\xff"))  # as a file may be named
    monkeypatch.setattr(compare_rungs, "compare", lambda path, say: [odd])
    assert main("ladder a.toml -o t.md --force".split()) == 0
    assert "| a\\udcff | " in Path("t.md").read_text()


def test_read_only_files_are_kept(folder, monkeypatch):
    made("m.h5")
    os.chmod("m.h5", 0o444)
    access = os.access
    if access("m.h5", os.W_OK):  # for root everything is
        monkeypatch.setattr(
            os, "access", lambda path, mode: Path(path).name != "m.h5" and access(path, mode)
        )
    with pytest.raises(StoreError, match="^m.h5: cannot be written: it is read-only"):
        run(make_spec(), "m.h5", force=True, evaluate=pytest.fail)
    assert Path("m.h5").read_bytes() == b"precious"


def test_a_folder_that_lets_only_owners_replace(folder, monkeypatch):
    """As /tmp is: a file can be made there, and another's cannot be replaced."""
    made("m.h5")
    os.chmod(".", 0o1777)
    check_output("m.h5", force=True)
    monkeypatch.setattr(os, "geteuid", lambda: os.stat("m.h5").st_uid + 1)
    with pytest.raises(
        StoreError, match="^m.h5: cannot be written: its folder lets only its owner"
    ):
        check_output("m.h5", force=True)


@pytest.mark.parametrize(
    ("name", "line"),
    [
        (os.fsdecode(b"m\xff.h5"), "must have a name in UTF-8, but was b'm\\xff.h5'"),
        (os.fsdecode(b"f\xff/m.h5"), "must have a name in UTF-8, but was b'f\\xff/m.h5'"),
        ("a\x00.h5", "must have a name in UTF-8 without null characters"),
        ("m" * 248 + ".h5", "cannot be written: File name too long"),
    ],
)
def test_names_that_fail_later_are_refused_first(name, line, folder, capsys):
    """Such a name failed when the map was put together, or the run was written: after the work."""
    Path(os.fsdecode(b"f\xff")).mkdir()
    with pytest.raises(StoreError) as refused:
        run(make_spec(), name, evaluate=pytest.fail)
    assert line in str(refused.value) and str(refused.value).isprintable()
    before = sorted(os.listdir())
    if "\x00" not in name:  # which no command line can hold
        assert line in said(capsys, ["sweep", "s.toml", "-o", name])
    assert sorted(os.listdir()) == before


def test_a_sweep_file_may_have_any_name(folder, capsys):
    name = os.fsdecode(b"s\xff.toml")
    Path("s.toml").rename(name)
    assert main(["sweep", name, "-o", "m.h5", "--no-picture", "--block", str(BLOCK)]) == 0
    with open_map("m.h5") as ds:
        assert "s\\udcff.toml" in ds.attrs["command"]
    assert capsys.readouterr().err == ""


def test_a_scene_may_have_any_name(tmp_path, monkeypatch):
    """`simulate`, `follow` and `ladder` computed all and then failed to write by which command."""
    monkeypatch.setattr(sys, "argv", ["wiperjax", "simulate", os.fsdecode(b"s\xff.toml")])
    whole.write_dataset(xr.Dataset(attrs={"command": command_line()}), tmp_path / "r.h5")
    with xr.open_dataset(tmp_path / "r.h5", engine="h5netcdf") as ds:
        assert ds.attrs["command"] == "wiperjax simulate 's\\udcff.toml'"


def test_text_that_the_terminal_cannot_show(tmp_path):
    """The work is done when the table is printed: a character must not end it."""
    whole.write_dataset(
        xr.Dataset(attrs={"title": "Wischerlippe bei 5 Grad, \u03bc = 1"}), tmp_path / "r.h5"
    )
    ran = subprocess.run(
        [sys.executable, "-m", "wiperjax", "info", "r.h5"],
        cwd=tmp_path,
        env=os.environ | {"PYTHONIOENCODING": "ascii"},
        capture_output=True,
        text=True,
    )
    assert ran.returncode == 0 and "\\u03bc = 1" in ran.stdout and ran.stderr == ""


def test_nothing_is_left_by_looking(folder):
    check_output("new.h5")
    check_output(made("old.h5"), force=True)
    assert sorted(os.listdir()) == ["old.h5", "s.toml"]
    assert Path("old.h5").read_bytes() == b"precious"


def test_a_folder_in_which_nothing_can_be_made(folder, monkeypatch):
    """Permissions do not say it all: quotas, network disks, flags of a file system."""
    real = files.os.open

    def failing(path, flags, *rest, **more):
        if flags & os.O_TMPFILE == os.O_TMPFILE:
            raise OSError(errno.EDQUOT, os.strerror(errno.EDQUOT), path)
        return real(path, flags, *rest, **more)

    monkeypatch.setattr(files.os, "open", failing)
    with pytest.raises(StoreError, match="^m.h5: cannot be written: Disk quota exceeded"):
        run(make_spec(), "m.h5", evaluate=pytest.fail)


# --- parts on another disk ------------------------------------------------------------------------


def test_parts_on_another_disk_are_refused_before_the_first_cell(folder, monkeypatch):
    away = folder / "away"
    away.mkdir()
    os.symlink(away, "m.h5.parts")
    real = os.rename

    def rename(source, target):
        raise OSError(errno.EXDEV, os.strerror(errno.EXDEV), source)

    monkeypatch.setattr(os, "rename", rename)
    for how in ({}, {"force": True}, {"resume": True}):
        with pytest.raises(StoreError) as refused:
            run(make_spec(), "m.h5", evaluate=pytest.fail, **how)
        assert str(refused.value) == (
            "m.h5.parts: must be on the disk of m.h5, for files are moved there "
            "(Invalid cross-device link)"
        )
    assert list(away.iterdir()) == []
    monkeypatch.setattr(os, "rename", real)
    run(make_spec(), "m.h5").close()  # a link to the same disk serves


def test_parts_that_really_are_on_another_disk(folder, tmp_path_factory):
    other = Path("/dev/shm")
    if not other.is_dir() or os.stat(other).st_dev == os.stat(folder).st_dev:
        pytest.skip("there is one file system only")
    away = other / f"wiperjax-{os.getpid()}"
    away.mkdir()
    try:
        os.symlink(away, "m.h5.parts")
        with pytest.raises(StoreError, match="^m.h5.parts: must be on the disk of m.h5, for"):
            run(make_spec(), "m.h5", evaluate=pytest.fail)
        assert list(away.iterdir()) == []
    finally:
        away.rmdir()


# --- what belongs to somebody else ----------------------------------------------------------------


def test_a_map_that_appears_meanwhile_is_not_replaced(folder):
    spec = make_spec()

    def busy(spec, index):
        made("m.h5")
        return evaluate(spec, index)

    with pytest.raises(StoreError) as refused:
        run(spec, "m.h5", evaluate=busy)
    assert str(refused.value) == (
        "m.h5: was made by another program meanwhile; move it away and go on with --resume"
    )
    assert Path("m.h5").read_bytes() == b"precious"
    Path("m.h5").unlink()
    run(spec, "m.h5", resume=True, evaluate=pytest.fail).close()  # all blocks were kept


def sweep(*flags):
    return main(["sweep", "s.toml", "-o", "m.h5", "--block", str(BLOCK), *flags])


def stop_after(monkeypatch, blocks):
    """The engine is interrupted after some blocks."""
    done = []

    def stopping(spec, index):
        if len(done) == blocks:
            raise KeyboardInterrupt
        done.append(index)
        return evaluate(spec, index)

    computed_by(monkeypatch, stopping)


def go_on(monkeypatch):
    computed_by(monkeypatch, evaluate)


def test_a_picture_of_somebody_else_is_kept_on_resume(folder, monkeypatch, capsys):
    stop_after(monkeypatch, 3)
    assert sweep() == 130
    made("m.png")
    go_on(monkeypatch)
    capsys.readouterr()
    line = said(capsys, "sweep s.toml -o m.h5 --resume")
    assert line.startswith("m.png: exists already")
    assert Path("m.png").read_bytes() == b"precious" and not Path("m.h5").exists()
    assert sweep("--resume", "--no-picture") == 0
    assert Path("m.png").read_bytes() == b"precious"
    assert said(capsys, "sweep s.toml -o m.h5 --resume").startswith("m.png: exists already")
    assert Path("m.png").read_bytes() == b"precious"


@pytest.mark.long
def test_the_picture_of_this_sweep_is_drawn_again(folder, monkeypatch, capsys):
    """Killed between the picture and the end: the same command must come to an end."""
    assert sweep() == 0
    first = Path("m.png").read_bytes()
    assert sweep("--resume") == 0
    assert Path("m.png").read_bytes() == first
    # another picture of the same map was asked for by somebody, and is his
    assert main("plot m.h5 -o m.png --force -p classes".split()) == 0
    classes = Path("m.png").read_bytes()
    capsys.readouterr()
    assert said(capsys, "sweep s.toml -o m.h5 --resume").startswith("m.png: exists already")
    assert Path("m.png").read_bytes() == classes
    # of another sweep the map is told, not its picture
    Path("s.toml").write_text(Path("s.toml").read_text().replace("window = ", "window = 1"))
    assert said(capsys, "sweep s.toml -o m.h5 --resume").startswith("m.h5: was made otherwise")


@pytest.mark.slow
def test_leave_to_replace_holds_for_the_picture_too(folder, monkeypatch):
    """A sweep that was begun with --force and stopped goes on as it was begun."""
    made("m.h5")
    made("m.png")
    stop_after(monkeypatch, 3)
    assert sweep("--force") == 130
    assert BlockStore.may_replace("m.h5")
    go_on(monkeypatch)
    assert sweep("--resume") == 0
    assert Path("m.png").read_bytes().startswith(b"\x89PNG")
    with open_map("m.h5") as ds:
        assert "label" in ds


def test_modes_of_new_files_are_those_of_the_process(folder):
    """Looking whether a file can be made leaves nothing of its own behind."""
    before = os.umask(0o027)
    try:
        run(make_spec(), "m.h5").close()
    finally:
        os.umask(before)
    assert stat.S_IMODE(os.stat("m.h5").st_mode) == 0o640


@pytest.mark.long
def test_the_picture_of_a_map_goes_with_it_where_it_may_be_replaced(folder, monkeypatch, capsys):
    """Once the new map is finished nobody knows that it was: a refinement may be stopped after."""

    def stopped(*_):
        raise KeyboardInterrupt

    refining = sys.modules["wiperjax.cli.refine"]  # the name is that of the command
    made("m.h5")
    made("m.png")
    monkeypatch.setattr(refining, "run", stopped)
    assert sweep("--force", "--refine", "1") == 130
    assert not Path("m.png").exists()
    monkeypatch.setattr(refining, "run", lambda *_: None)
    assert sweep("--resume", "--refine", "1") == 0
    drawn = Path("m.png").read_bytes()
    monkeypatch.setattr(refining, "run", stopped)
    assert sweep("--resume", "--refine", "1") == 130
    assert Path("m.png").read_bytes() == drawn  # of this map
    made("m.png")
    capsys.readouterr()  # what may not be replaced is said before hours are spent
    line = said(capsys, "sweep s.toml -o m.h5 --resume --refine 1")
    assert line.startswith("m.png: exists already")
    assert Path("m.png").read_bytes() == b"precious"
