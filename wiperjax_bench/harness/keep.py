"""Finished parts of a long measurement, kept until all of it is done."""

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from . import measure

FORMAT = 3  # of what is kept: another one is measured anew


class Parts:
    """Files in `<output>.parts/`, one a part, that only a run of the same kind takes up again.

    Same kind: the same ``settings``, libraries and machine.
    """

    def __init__(self, output: Path, settings: dict[str, Any]):
        versions = {k: v for k, v in measure.versions().items() if k != "commit"}
        key = {"format": FORMAT, "versions": versions, "machine": measure.machine()}
        text = json.dumps(key | settings, sort_keys=True, default=str)
        self.digest = hashlib.sha256(text.encode()).hexdigest()[:12]
        self.folder = output.with_name(output.name + ".parts")
        self.folder.mkdir(parents=True, exist_ok=True)

    def once(self, name: str, make: Callable[[], Any], say: Callable[[str], None] = print) -> Any:
        """Return what ``make`` returns (JSON), or returned in a run that was stopped."""
        kept = self.folder / f"{name}-{self.digest}.json"
        if kept.exists():
            say(f"{name}: kept from a run that was stopped")
        else:
            temporary = kept.with_suffix(".tmp")
            temporary.write_bytes(json.dumps(make()).encode())
            temporary.replace(kept)
        return json.loads(kept.read_bytes())

    def clear(self) -> None:
        """Remove the folder with everything in it: the whole is written."""
        for file in self.folder.iterdir():
            file.unlink()
        self.folder.rmdir()
