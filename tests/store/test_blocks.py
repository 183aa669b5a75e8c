"""Blocks on the disk: every change is noticed, and one process writes."""

import logging
import os
import random
import subprocess
import sys

import pytest
from processes import environment
from stub_sweep import IDENTITY, block_files, fill, half_done, make_spec, open_store

from wiperjax.machine.files import StoreError
from wiperjax.store.blocks import BlockStore
from wiperjax.store.manifest import parts_of


def test_every_flipped_byte_is_noticed(tmp_path):
    spec, path = make_spec(), tmp_path / "map.h5"
    half_done(path, spec, 1)
    (file,) = block_files(path)
    content = file.read_bytes()
    store = BlockStore.peek(parts_of(path))
    logging.getLogger("wiperjax").setLevel(logging.ERROR)
    try:
        for place in random.Random(1).sample(range(len(content)), 300):
            file.write_bytes(
                content[:place] + bytes([content[place] ^ (1 << place % 8)]) + content[place + 1 :]
            )
            store._names[0] = file.name
            assert store.read(0) is None and not store.done()[0]
        file.write_bytes(content)
        store._names[0] = file.name
        assert store.read(0) is not None
    finally:
        logging.getLogger("wiperjax").setLevel(logging.NOTSET)


@pytest.mark.parametrize("name", ["precision", "jax"])
def test_another_version_or_precision_is_refused(tmp_path, name):
    path, spec = tmp_path / "map.h5", make_spec()
    open_store(path, spec).close()
    with pytest.raises(StoreError, match=f"{name} was {IDENTITY[name]}, now other"):
        open_store(path, spec, identity=IDENTITY | {name: "other"}, resume=True)


def test_a_block_of_another_place_says_what_may_be_done(tmp_path):
    path, spec = tmp_path / "map.h5", make_spec()
    with open_store(path, spec) as store:
        fill(store, spec, [0])
    (file,) = block_files(path)
    file.rename(file.with_name(file.name.replace("00000000", "00000001")))
    with pytest.raises(StoreError, match="move the block away, or use --force to start anew$"):
        open_store(path, spec, resume=True)


def test_two_writers_are_told_apart(tmp_path):
    path, spec = tmp_path / "map.h5", make_spec()
    with open_store(path, spec) as store:
        fill(store, spec, [0])
        code = (
            "import sys; from pathlib import Path\n"
            "from stub_sweep import make_spec, open_store\n"
            "from wiperjax.machine.files import StoreError\n"
            "try: open_store(Path(sys.argv[1]), make_spec(), resume=True)\n"
            "except StoreError as error: print(error)\n"
        )
        words = [sys.executable, "-c", code, path]
        said = subprocess.run(words, capture_output=True, text=True, env=environment()).stdout
        assert f"is being written by process {os.getpid()}" in said
        with pytest.raises(StoreError, match="is being written by process"):
            open_store(path, spec, force=True)
        assert store.done()[0]
    open_store(path, spec, resume=True).close()  # a closed store is free
