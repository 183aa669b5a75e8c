"""Finished maps opened."""

import pytest

from wiperjax.machine.files import StoreError
from wiperjax.store.whole import open_map


def test_files_that_are_no_maps(tmp_path):
    with pytest.raises(StoreError, match="does not exist"):
        open_map(tmp_path / "none.h5")
    for content in (b"", b"\x89HDF\r\n\x1a\n", b"text"):
        (tmp_path / "bad.h5").write_bytes(content)
        with pytest.raises(StoreError, match="bad.h5: is not a readable map"):
            open_map(tmp_path / "bad.h5")
