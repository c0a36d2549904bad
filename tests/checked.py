"""The environment of processes whose heap is looked at: what they overrun, or release twice, ends them."""

import os
from pathlib import Path

CHECKED = os.environ | {"PYTHONMALLOC": "debug"}
"""Python's debug allocator, from which the engine takes its memory, puts forbidden bytes around each block."""
_LIBRARY = next(Path("/").glob("lib/*/libc_malloc_debug.so.0"), None)
if _LIBRARY is not None:  # MALLOC_CHECK_ alone does nothing since glibc 2.34
    CHECKED |= {"LD_PRELOAD": str(_LIBRARY), "MALLOC_CHECK_": "3"}
