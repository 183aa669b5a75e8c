"""Disks that are full or cannot be written to: one clear line, and nothing finished is lost."""

import errno
import os
import resource
import shutil
import subprocess

import pytest
from stub_sweep import assert_same_map, block_files, half_done, make_spec, run, whole

from wiperjax.machine.files import StoreError
from wiperjax.store import partial
from wiperjax.store.manifest import parts_of
from wiperjax.store.whole import write_dataset


def test_places_that_cannot_be_written_to(tmp_path):
    spec = make_spec()
    (tmp_path / "file").write_text("")
    for path in (tmp_path / "file" / "map.h5", tmp_path / "none" / "map.h5"):
        with pytest.raises(StoreError, match=f"{path}: cannot be written"):
            run(spec, path)
    with pytest.raises(StoreError, match="it is a folder"):
        run(spec, tmp_path, force=True)
    assert [entry.name for entry in tmp_path.iterdir()] == ["file"]


def test_a_read_only_folder(tmp_path):
    folder = tmp_path / "locked"
    folder.mkdir(mode=0o500)
    if os.access(folder, os.W_OK):  # root may write anywhere, unless the file system itself says no
        words = ["mount", "-t", "tmpfs", "-o", "ro", "tmpfs", folder]
        if not shutil.which("mount") or subprocess.run(words, capture_output=True).returncode:
            pytest.skip("neither permissions nor mounts can make a folder read-only here")
    try:
        with pytest.raises(
            StoreError, match="cannot be written: (no permission|Read-only file system)"
        ):
            run(make_spec(), folder / "map.h5")
    finally:
        subprocess.run(["umount", folder], capture_output=True)


@pytest.fixture
def small_disk(tmp_path):
    """Folder on a file system of 400 KiB."""
    folder = tmp_path / "small"
    folder.mkdir()
    words = ["mount", "-t", "tmpfs", "-o", "size=400k", "tmpfs", folder]
    if (
        os.geteuid()
        or not shutil.which("mount")
        or subprocess.run(words, capture_output=True).returncode
    ):
        pytest.skip("no small file system can be mounted here")
    yield folder
    subprocess.run(["umount", folder], check=True)


@pytest.mark.long
def test_a_full_disk_loses_no_finished_block(small_disk):
    """At every level of filling: one clear line, finished blocks and other files kept, and room
    makes it go on.
    """
    spec, path, ballast = make_spec(), small_disk / "map.h5", small_disk / "ballast"
    full, stages = 0, set()
    for free in range(0, 400, 24):
        ballast.write_bytes(b"x" * max(0, _free(small_disk) - free * 1024))
        try:
            run(spec, path)
        except StoreError as error:
            full += 1
            assert (
                os.strerror(errno.ENOSPC) in str(error)
                and str(small_disk) in str(error)
                and "\n" not in str(error)
            )
            assert not path.exists()
            if (parts_of(path) / "manifest.json").exists():
                stages.add(int(partial.open_partial(parts_of(path)).done.sum()))
            assert not list(parts_of(path).glob(".*")) if parts_of(path).exists() else True
        ballast.unlink()
        run(spec, path, resume=True)
        assert_same_map(path, spec)
        path.unlink()
    # Full while blocks are written, and (all 385 cells done) while the map is.
    assert full >= 4 and len(stages) >= 3 and 385 in stages, (full, stages)


def _free(folder):
    found = os.statvfs(folder)
    return found.f_bavail * found.f_frsize


def test_a_file_size_limit_is_an_error_like_a_full_disk(tmp_path):
    """The same without a mount, for machines where that is not allowed."""
    spec, path = make_spec(), tmp_path / "map.h5"
    half_done(path, spec, 3)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (3000, before[1]))
    try:
        with pytest.raises(
            StoreError, match=f"block-00000003.*cannot be written: {os.strerror(errno.EFBIG)}"
        ):
            run(spec, path, resume=True)
        with pytest.raises(StoreError, match="ds.h5: cannot be written"):
            write_dataset(whole(spec), tmp_path / "ds.h5")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert (
        len(block_files(path)) == 3
        and not list(parts_of(path).glob(".*"))
        and not (tmp_path / "ds.h5").exists()
    )
    run(spec, path, resume=True)
    assert_same_map(path, spec)
