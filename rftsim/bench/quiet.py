"""Sand under models whose doubts are of no interest, because they were drawn at random or are others'."""

import contextlib
import warnings
from collections.abc import Iterator

from rftsim.errors import RftsimNote, RftsimWarning


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """A context in which notes and doubts about models are not told."""
    with warnings.catch_warnings():
        for kind in (RftsimNote, RftsimWarning):
            warnings.simplefilter("ignore", kind)
        yield
