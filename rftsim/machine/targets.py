"""The processors that machine code ships for."""

from typing import Final, NamedTuple


class Target(NamedTuple):
    """A level of x86-64 processors that machine code is made for."""

    name: str
    """Its name, as LLVM knows it."""
    needs: tuple[str, ...]
    """Features without which it does not run."""
    tuned: str = ""
    """What LLVM is told beside the name."""


AVX2: Final = Target("x86-64-v3", ("avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe"))
AVX512: Final = Target(
    "x86-64-v4",
    (*AVX2.needs, "avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"),
    "-prefer-256-bit",  # else its vectors are no wider
)
TARGETS: Final = {"law": (AVX512, AVX2), "solver": (AVX2,), "engine": (AVX2,)}
"""The levels that each part ships for, of which the first that runs is taken; only the law's loops are long enough for
wide vectors."""
