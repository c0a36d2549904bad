"""Machine code of the entries: what ships where it fits, else what was compiled before, else compiled now.

It is made by `build` in parts, each an object file of LLVM. What ships is for `targets` under Linux and was made from
these very sources; then neither numba nor a cache is needed.
"""

import ctypes
import functools
import hashlib
import logging
import lzma
import os
import stat
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Final

import llvmlite
import llvmlite.binding as llvm

from rftsim.errors import RftsimError
from rftsim.files import replacing
from rftsim.machine.sources import PACKAGE, source_of
from rftsim.machine.targets import TARGETS, Target

SHIPPED: Final = Path(__file__).parent / "shipped"
SUMS: Final = SHIPPED / "SHA256SUMS"
"""The SHA-256 of each object file that ships, as `sha256sum` writes them; one that is not as listed is not linked."""
KEPT: Final = "rftsim-machine"
"""The folder for what was compiled here."""
_LOG: Final = logging.getLogger(__name__)


@functools.cache
def load(part: str, given: str = "") -> Callable[[str], int]:
    """Link a part into the process, after those that it calls: the solver calls the law, and the engine both.

    Args:
        part: Its name, one of `sources.PARTS`.
        given: What else it is compiled from than the sources.

    Returns:
        What gives an entry's address by name.
    """
    engine = _engine()
    engine.add_object_file(llvm.ObjectFileRef.from_data(object_file(part, given)))
    engine.finalize_object()

    def address(name: str) -> int:
        found: int = engine.get_function_address(name)
        llvm.add_symbol(name, found)
        return found

    return address


def _failed(name: bytes) -> None:
    """Called by machine code that met what Python would raise an error for."""
    _LOG.error("%s divided by zero or the like; this force of the sand is not to be trusted", name.decode())


_FAILED: Final = ctypes.CFUNCTYPE(None, ctypes.c_char_p)(_failed)


@functools.cache
def _engine() -> llvm.ExecutionEngine:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    llvm.add_symbol("rftsim_failed", ctypes.cast(_FAILED, ctypes.c_void_p).value)
    machine = llvm.Target.from_default_triple().create_target_machine(jit=True)
    return llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)


def object_file(part: str, given: str) -> bytes:
    """The object file of a part: what ships, what was compiled before, or what is compiled now."""
    key = key_of(part, given)
    for target in filter(runs, TARGETS[part]):
        path = shipped_file(part, target)
        if is_as_listed(path) and (code := _read(path, key)) is not None:
            return code
    machine = f"{llvm.get_host_cpu_name()} {llvm.get_host_cpu_features().flatten()} {llvmlite.__version__}"
    key = hashlib.sha256(key + machine.encode()).digest()
    name = f"rftsim-{part}-{key.hex()[:16]}.o.xz"
    for folder in folders():
        path = folder / name
        if path.exists() and is_only_ours(folder, path) and (code := _read(path, key)) is not None:
            return code
    _LOG.warning("rftsim compiles its %s for this machine, once; it takes a minute or two", part)
    from rftsim.machine.build import build  # which needs numba

    code = build(part)
    for folder in folders():
        if _is_made(folder) and write(folder / name, key, code):
            break
    return code


def _is_made(folder: Path) -> bool:
    """Make a folder that this user alone can write, if there is none; whether it is there and is one."""
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError:
        return False
    return is_only_ours(folder)


def is_only_ours(*paths: Path) -> bool:
    """Whether nobody but this user, and root, can write paths; where systems know no owners, whoever wrote is trusted.

    Machine code that another could have put there is not to run.
    """
    if not hasattr(os, "getuid"):
        return True
    for path in paths:
        try:
            found = path.lstat()
        except OSError:
            return False
        if found.st_uid not in (os.getuid(), 0) or stat.S_ISLNK(found.st_mode) or found.st_mode & 0o022:
            _LOG.warning(
                "rftsim takes no compiled code from %s, which others can write: chmod go-w, or delete it", path
            )
            return False
    return True


def key_of(part: str, given: str) -> bytes:
    """Identifies what a part is compiled from."""
    return hashlib.sha256(source_of(part) + given.encode()).digest()


def shipped_file(part: str, target: Target) -> Path:
    """Where a part lies that ships with the package, as it was made for a level of processors."""
    return SHIPPED / f"{part}-{target.name}.o.xz"


def sum_of(path: Path) -> str:
    """The SHA-256 of a file, in hexadecimal digits."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def is_as_listed(path: Path) -> bool:
    """Whether a file that ships is byte for byte the one that the list of hashes names; False where it is missing."""
    try:
        return f"{sum_of(path)}  {path.name}" in SUMS.read_text().splitlines()
    except OSError:
        return False


def runs(target: Target) -> bool:
    """Whether this process can run what ships for a level of processors."""
    triple = llvm.get_process_triple()
    if not (triple.startswith("x86_64") and "linux" in triple):
        return False
    features = llvm.get_host_cpu_features()
    return all(features.get(name, False) for name in target.needs)


def folders() -> list[Path]:
    """Where compiled code may be kept: in a folder of its own, which this user alone can write, in numba's places."""
    if chosen := os.environ.get("NUMBA_CACHE_DIR"):
        return [Path(chosen) / KEPT]
    users = {"darwin": "~/Library/Caches", "win32": "~/AppData/Local"}.get(sys.platform, "~/.cache")
    users = os.path.expanduser(os.environ.get("XDG_CACHE_HOME") or users)
    own = PACKAGE / "__pycache__" / KEPT
    return [own, Path(users) / "numba" / KEPT] if os.path.isabs(users) else [own]  # else it knows no home


def is_made_from(path: Path, key: bytes) -> bool:
    """Whether a file holds a part that was written under a key, and is as listed."""
    return is_as_listed(path) and _read(path, key) is not None


def _read(path: Path, key: bytes) -> bytes | None:
    """A whole object file that was written under the same key, or None."""
    try:
        found = path.read_bytes()
        return lzma.decompress(found[len(key) :]) if found.startswith(key) else None
    except (OSError, lzma.LZMAError):
        return None


def write(path: Path, key: bytes, code: bytes) -> bool:
    """Write an object file, whole or not at all; whether it could be written."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as temporary:
            temporary.write_bytes(key + lzma.compress(code))
    except (OSError, RftsimError):
        return False
    return True
