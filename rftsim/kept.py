"""What was measured once, kept in a file, so that a study can be stopped and taken up again."""

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rftsim.files import replacing


class Kept:
    """Measurements by name.

    Args:
        path: The file, JSON; written whole after each measurement.
        inputs: Everything that all the measurements depend on; what was kept under other inputs is measured again.
    """

    def __init__(self, path: Path, inputs: bytes) -> None:
        self.path = path
        self.key = hashlib.sha256(inputs).hexdigest()
        self.known: dict[str, Any] = {}
        if path.is_file():
            kept = json.loads(path.read_text())
            if kept.get("key") == self.key:
                self.known = kept["known"]

    def get(self, name: str, measure: Callable[[], Any]) -> Any:
        """What `measure` gives, as JSON has it, measured now or before."""
        if name not in self.known:
            self.known[name] = measure()
            with replacing(self.path) as temporary:
                temporary.write_text(json.dumps({"key": self.key, "known": self.known}))
        return self.known[name]
