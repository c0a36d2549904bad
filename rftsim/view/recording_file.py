"""The file of a recording: checked before anything is recorded, and read back before it is put in its place."""

import os
from collections import Counter
from collections.abc import Mapping
from pathlib import Path

from rerun.chunk import RrdReader

from rftsim.errors import RftsimError
from rftsim.files import check_writable, replacing


def check_recordable(path: Path) -> None:
    """Refuse a path that a recording cannot be written to.

    Raises:
        RftsimError: It does not end in .rrd, its folder cannot be written, or something stands there that is no file.
    """
    if path.suffix != ".rrd":
        raise RftsimError(f"a recording must be called *.rrd, by which Rerun knows it, not {path.name!r}")
    check_writable(path)
    if path.exists() and not (path.is_file() and os.access(path, os.W_OK)):
        raise RftsimError(f"cannot write {path}: it exists and is not a file that may be replaced")


def write_verified(recording: bytes, rows: Mapping[str, int], path: Path) -> None:
    """Write a recording beside its place, see that each entity has all its rows in it, and put it in place.

    Raises:
        RftsimError: It could not be written, or lacks rows; what was at the path is left as it was.
    """
    try:
        with replacing(path) as temporary:
            temporary.write_bytes(recording)
            found: Counter[str] = Counter()
            for chunk in RrdReader(temporary).stream():
                found[chunk.entity_path] += chunk.num_rows
            missing = [entity for entity, count in rows.items() if found[entity] < count]
            if missing:
                raise RftsimError(f"rows are missing of {', '.join(missing)}")
    except (OSError, ValueError, RuntimeError) as error:
        raise RftsimError(f"the recording could not be written to {path}: {error}") from error
