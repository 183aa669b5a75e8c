"""What a store of blocks is part of: its manifest, and what tells two sweeps apart."""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..datasets import map_dataset
from ..machine.files import StoreError, check_input, reason, write_bytes

FORMAT = 2
MANIFEST = "manifest.json"
ANEW = "use --force to start anew"  # what a person may do with a store that is of no use


def create(
    parts: Path, spec: Any, block: int, replace: bool, identity: Mapping[str, str]
) -> dict[str, Any]:
    """Writes the manifest of a new store into the folder `parts` and returns it.

    Arguments:

    - `block`: cells in a block.
    - `replace`: whether the finished map may replace a file.
    - `identity`: what must agree between parts of one map, text -> text.
    """
    manifest = _content(spec, block, replace, identity)
    manifest |= {"sha256": _checksum(manifest)}
    write_bytes(parts / MANIFEST, json.dumps(manifest, indent=1).encode())
    return manifest


def _content(spec: Any, block: int, replace: bool, identity: Mapping[str, str]) -> dict[str, Any]:
    """The manifest but for its checksum."""
    return {
        "format": FORMAT,
        "block": int(block),
        "cells": int(spec.size),
        "replace": bool(replace),
        "identity": dict(identity),
        "specification": spec.canonical(),
        "map": map_dataset.describe(spec),
    }


def _checksum(manifest: Mapping[str, Any]) -> str:
    """Hash of all entries but the hash itself."""
    rest = {name: value for name, value in manifest.items() if name != "sha256"}
    return hashlib.sha256(json.dumps(rest, sort_keys=True).encode()).hexdigest()


def read(parts: Path, anew: str = ANEW) -> dict[str, Any] | None:
    """Manifest of the store in the folder `parts`; None if it has none. `anew`: what a person may
    do where it is of no use.

    Raises: `StoreError` if it is damaged, cannot be read or is of another format.
    """
    path = parts / MANIFEST
    if not path.exists():
        return None
    check_input(path)
    try:
        manifest = json.loads(path.read_bytes())
        if manifest["format"] != FORMAT:
            raise StoreError(
                f"{path}: was made by another version of wiperjax "
                f"(store format {manifest['format']})"
            )
        if manifest["sha256"] != _checksum(manifest):
            raise ValueError("checksum")
        return manifest
    except (ValueError, KeyError, TypeError) as error:
        raise StoreError(f"{path}: is damaged; {anew}") from error
    except OSError as error:
        raise StoreError(f"{path}: cannot be read: {reason(error)}") from error


def resumed(
    parts: Path,
    manifest: Mapping[str, Any],
    spec: Any,
    identity: Mapping[str, str],
    anew: str = ANEW,
) -> dict[str, Any]:
    """The manifest of a store that is gone on with: all that `spec` says is taken from there again,
    the checksum, by which blocks know their manifest, from the file.

    Raises: `StoreError` that says what differs if it is not that of `spec` and `identity`.
    """
    stored = manifest["identity"] | {"specification": manifest["specification"]}
    if said := unlike(stored, dict(identity) | {"specification": spec.canonical()}):
        raise StoreError(
            f"{parts}: was made otherwise, its blocks do not belong to this sweep ({said}); {anew}"
        )
    content = _content(spec, manifest["block"], manifest["replace"], identity)
    return content | {"sha256": manifest["sha256"]}


def place(manifest: Mapping[str, Any], span: tuple[int, int]) -> dict[str, Any]:
    """What a block says of where it belongs: its cells, and the checksum of its manifest (which
    holds the digest of the specification and all else that must agree).
    """
    return {"start": span[0], "stop": span[1], "manifest": manifest["sha256"]}


def unlike(was: Mapping[str, str], now: Mapping[str, str]) -> str:
    """What differs of that which must agree between parts of one map, text -> text, in words for a
    person; empty if nothing does. A `specification` is a canonical one.
    """
    said = []
    for name in sorted(was.keys() | now.keys()):
        old, new = was.get(name, "none"), now.get(name, "none")
        if old != new and name == "specification":
            said.append(_first_difference(old, new))
        elif old != new:
            said.append(f"{name} was {old}, now {new}")
    return "; ".join(said)


def _first_difference(was: str, now: str) -> str:
    """First few keys that differ between two canonical specifications, with both values."""
    old, new = _flatten(json.loads(was)), _flatten(json.loads(now))
    keys = [key for key in sorted(old.keys() | new.keys()) if old.get(key) != new.get(key)]
    shown = []
    for key in keys[:3]:
        owner = new.get(key.removesuffix("_source"))
        if key.endswith("_source") and owner == old.get(key.removesuffix("_source")):
            shown.append(f"{owner} has another source, or other tables in it, than it had")
        else:
            shown.append(f"{key} was {_short(old.get(key))}, now {_short(new.get(key))}")
    return ", ".join(shown) + (f", and {len(keys) - 3} more" if len(keys) > 3 else "")


def _flatten(value: Any, prefix: str = "") -> dict[str, Any]:
    """Leaves of nested dicts (and of the list of axes, pairs) by their dotted name."""
    if (
        isinstance(value, list)
        and value
        and all(isinstance(i, list) and len(i) == 2 for i in value)
    ):
        value = dict(value)
    if not isinstance(value, dict):
        return {prefix: value}
    return {
        k: v
        for key, item in value.items()
        for k, v in _flatten(item, f"{prefix}.{key}".strip(".")).items()
    }


def _short(value: Any) -> str:
    if isinstance(value, list) and len(value) > 4:
        return f"{len(value)} values from {value[0]} to {value[-1]}"
    return "absent" if value is None else str(value)


def parts_of(output: str | Path) -> Path:
    """Folder beside `output` that holds its finished blocks while the sweep is not complete."""
    return Path(f"{output}.parts")
