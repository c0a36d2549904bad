"""Tables of addresses: arrays that compiled functions share, declared one by one and laid out in one piece of memory.

What works on a table takes its address p alone: it can so be compiled once, and called apart, whatever it works on.
"""

from typing import Any

import numpy as np

from rftsim.machine.compiling import exact, inline
from rftsim.machine.memory import doubles, int64s, matrix, peek, poke, stack_doubles
from rftsim.machine.records import record_at, record_behind, records_behind

Size = int | str
"""A number, or the name of a count of the table."""


class Table:
    """A table: a head of int64, then the address of each array that was declared.

    Args:
        head: The head's fields, of which the first are counts.
        counts: The names of those, by which sizes are given.
    """

    def __init__(self, head: "np.dtype[Any]", counts: tuple[str, ...]) -> None:
        self.head = record_at(head)
        """The head of the table at p."""
        self._names, self._counts = head.names or (), counts
        self._sizes: list[list[int]] = []
        """For each array a constant, and the powers of the counts, that make its size."""

    @property
    def size(self) -> int:
        """Numbers of the table itself, int64."""
        return len(self._names) + len(self._sizes)

    def vector(self, size: Size, times: Size = 1, view: Any = doubles) -> Any:
        """Declare an array of one axis, whose size may be a product, and make what gives it from p."""
        entry, n, m = self._declare(size, times), self._number(size), self._number(times)

        @exact
        def get(p):
            return view(_address(p, entry), n(p) * m(p))

        return get

    def matrix(self, rows: Size, columns: Size) -> Any:
        """Declare an array of two axes, and make what gives it from p."""
        entry, m, n = self._declare(rows, columns), self._number(rows), self._number(columns)

        @exact
        def get(p):
            return matrix(_address(p, entry), m(p), n(p))

        return get

    def vectors(self, size: Size, *count: Size, view: Any = doubles) -> Any:
        """Declare as many vectors as the product of counts says, and make what gives the k-th from p and k."""
        entry, n = self._declare(size, *count), self._number(size)

        @exact
        def get(p, k):
            return view(_address(p, entry) + 8 * k * n(p), n(p))

        return get

    def each(self, count: str, rows: int, columns: "Size | None" = None) -> tuple[Any, Any]:
        """Declare an array for each of a count, and make what gives the k-th from p and k, and all of them flat."""
        entry, n, m = self._declare(count, rows, columns or 1), self._number(columns or 1), self._number(count)

        @exact
        def vector(p, k):
            return doubles(_address(p, entry) + 8 * k * rows, rows)

        @exact
        def one(p, k):
            return matrix(_address(p, entry) + 8 * k * rows * n(p), rows, n(p))

        @exact
        def flat(p):
            return doubles(_address(p, entry), m(p) * rows * n(p))

        return vector if columns is None else one, flat

    def record(self, dtype: "np.dtype[Any]") -> Any:
        """Declare a record of float64, and make what gives it from p."""
        return record_behind(dtype, self._declare(dtype.itemsize // 8))

    def records(self, dtype: "np.dtype[Any]", count: Size) -> Any:
        """Declare records of float64, and make what gives the k-th from p and k."""
        return records_behind(dtype, self._declare(count, dtype.itemsize // 8))

    def outer(self, dtype: "np.dtype[Any]", name: str) -> Any:
        """Make what gives, from p, the record whose address a field of the head holds."""
        return record_behind(dtype, self._names.index(name))

    def layout(self) -> Any:
        """A compiled function that fills the table at p with distances from one place, and gives all arrays' bytes."""
        outer, whole, counts = len(self._names), self.size, len(self._counts)
        kinds, kind = np.unique([powers for _, *powers in self._sizes], axis=0, return_inverse=True)
        room, bytes_each = len(kinds), np.array([8 * constant for constant, *_ in self._sizes])

        @exact
        def lay_out(p):
            table, products, at = int64s(p, whole), int64s(stack_doubles(room), room), 0
            for k in range(room):
                products[k] = 1
                for count in range(counts):
                    for _ in range(kinds[k, count]):
                        products[k] *= table[count]
            for array in range(len(kind)):
                poke(table, outer + array, at)
                at += bytes_each[array] * peek(products, kind[array])
            return at

        return lay_out

    def place(self) -> Any:
        """A compiled function that makes addresses, from one on, of the distances in the table at p."""
        outer, whole = len(self._names), self.size

        @exact
        def place(p, address):
            table = int64s(p, whole)
            for entry in range(outer, whole):
                table[entry] += address

        return place

    def _declare(self, *shape: Size) -> int:
        """Make place for an array; where its address stands in the table."""
        constant = int(np.prod([size for size in shape if isinstance(size, int)], dtype=int))
        self._sizes.append([constant, *(shape.count(name) for name in self._counts)])
        return len(self._names) + len(self._sizes) - 1

    def _number(self, size: Size) -> Any:
        """Make what gives a size from p."""
        entry = -1 if isinstance(size, int) else self._counts.index(size)

        @inline
        def constant(p):
            return size

        @inline
        def counted(p):
            return _address(p, entry)

        return constant if isinstance(size, int) else counted


@inline
def _address(p, entry):
    """An address, or a count, of the table at p."""
    return int64s(p, entry + 1)[entry]
