"""Single files that survive."""

import os
import stat

import pytest

from wiperjax.machine.files import StoreError, replacing, write_bytes


def test_a_file_that_appears_meanwhile_is_not_replaced(tmp_path):
    """Of two programs that made one new file both ended well, and one file was lost."""
    path = tmp_path / "run.h5"
    with pytest.raises(StoreError, match=r"run\.h5: was made by another program meanwhile; use"):
        with replacing(path, force=False) as temporary:
            temporary.write_bytes(b"mine")
            path.write_bytes(b"precious")
    assert path.read_bytes() == b"precious" and os.listdir(tmp_path) == ["run.h5"]
    path.unlink()
    write_bytes(path, b"mine", force=False)
    assert path.read_bytes() == b"mine" and os.listdir(tmp_path) == ["run.h5"]


def test_a_disk_without_links_takes_new_files_too(tmp_path, monkeypatch):
    def refused(*_):
        raise PermissionError

    monkeypatch.setattr(os, "link", refused)
    write_bytes(tmp_path / "run.h5", b"mine", force=False)
    assert (tmp_path / "run.h5").read_bytes() == b"mine" and os.listdir(tmp_path) == ["run.h5"]


def test_a_file_that_is_replaced_keeps_its_mode(tmp_path):
    """A map that its owner alone may read was everybody's once it was refined."""
    path = tmp_path / "map.h5"
    path.write_bytes(b"old")
    path.chmod(0o600)
    write_bytes(path, b"new")
    assert path.read_bytes() == b"new" and stat.S_IMODE(path.stat().st_mode) == 0o600
