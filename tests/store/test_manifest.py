"""The manifest says what the blocks are, and no change of it goes unseen."""

import json
import random

import pytest
from stub_sweep import (
    BLOCK,
    assert_same_map,
    half_done,
    make_spec,
    open_store,
    run,
)

from wiperjax.machine.files import StoreError
from wiperjax.store import manifest
from wiperjax.store.manifest import parts_of


def test_a_damaged_manifest_is_one_clear_line(tmp_path):
    spec, path = make_spec(), tmp_path / "map.h5"
    half_done(path, spec, 2)
    (parts_of(path) / "manifest.json").write_text('{"format": 1, "bl')
    with pytest.raises(StoreError, match=r"manifest.json: is damaged"):
        run(spec, path, resume=True)
    with pytest.raises(StoreError, match=r"manifest.json: is damaged"):
        run(spec, path)
    run(spec, path, force=True)
    assert_same_map(path, spec)


def test_every_flipped_byte_of_the_manifest_is_noticed(tmp_path):
    """Or harmless: what says which cells of which map these are cannot change unseen."""
    path = tmp_path / "map.h5"
    open_store(path, make_spec()).close()
    file = parts_of(path) / "manifest.json"
    content, whole_ = file.read_bytes(), manifest.read(parts_of(path))
    noticed = 0
    for place in random.Random(2).sample(range(len(content)), 300):
        changed = bytes([content[place] ^ (1 << place % 7)])
        file.write_bytes(content[:place] + changed + content[place + 1 :])
        try:
            assert manifest.read(parts_of(path)) == whole_, place
        except StoreError as error:
            assert str(error).startswith(f"{file}: ") and "--force" in str(error)
            noticed += 1
    assert noticed > 200


def test_manifest_tells_a_person_what_it_is(tmp_path):
    with open_store(tmp_path / "map.h5", make_spec()):
        manifest = json.loads((tmp_path / "map.h5.parts" / "manifest.json").read_text())
    assert (
        manifest["cells"] == 385
        and manifest["block"] == BLOCK
        and manifest["identity"]["precision"] == "float64"
    )
    assert manifest["map"]["coords"]["belt_speed"]["attrs"]["units"] == "m/s"
