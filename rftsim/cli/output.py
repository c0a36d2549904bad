"""What a command prints for programs."""

import json
from typing import Any


def print_json(value: Any) -> None:
    """Print a value as JSON, and nothing else, on standard output."""
    print(json.dumps(value, indent=2))
