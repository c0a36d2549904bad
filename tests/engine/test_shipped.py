"""The object files that ship are what the sources give, and nothing else."""

import lzma
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import rftsim
from rftsim.machine import link
from rftsim.machine.targets import AVX2

PACKAGE = Path(rftsim.__file__).parent
KEY = 32
"""Bytes of a key, before the compressed object."""


def test_each_is_as_listed():
    """A changed constant inside an object file cannot pass: the SHA-256 of each stands in the list, and no other."""
    shipped = {path.name for path in link.SHIPPED.glob("*.xz")}
    assert shipped == {line.split()[1] for line in link.SUMS.read_text().splitlines()}
    assert all(link.is_as_listed(link.SHIPPED / name) for name in shipped)


def test_another_byte_is_noticed(tmp_path, monkeypatch):
    """One byte of the compressed code differs, and the file is not linked."""
    for path in (*link.SHIPPED.glob("*.xz"), link.SUMS):
        shutil.copy(path, tmp_path)
    monkeypatch.setattr(link, "SUMS", tmp_path / link.SUMS.name)
    changed = tmp_path / link.shipped_file("law", AVX2).name
    assert link.is_as_listed(changed)
    content = bytearray(changed.read_bytes())
    content[KEY + 100] ^= 1
    changed.write_bytes(content)
    assert not link.is_as_listed(changed)


@pytest.mark.slow
def test_sources_give_them_byte_for_byte(tmp_path):
    """Built again, with another hash seed: key and object code of each part are those that ship."""
    shutil.copytree(PACKAGE, tmp_path / "rftsim", ignore=shutil.ignore_patterns("__pycache__", "*.xz", "SHA256SUMS"))
    environment = {**os.environ, "PYTHONHASHSEED": "7", "PYTHONPATH": str(tmp_path)}
    build = [sys.executable, "-P", str(tmp_path / "rftsim/machine/build.py")]
    subprocess.run(build, env=environment, cwd=tmp_path, check=True, capture_output=True)
    for path in sorted(link.SHIPPED.glob("*.xz")):
        shipped, built = path.read_bytes(), (tmp_path / "rftsim/machine/shipped" / path.name).read_bytes()
        assert shipped[:KEY] == built[:KEY]
        assert lzma.decompress(shipped[KEY:]) == lzma.decompress(built[KEY:]), path.name
