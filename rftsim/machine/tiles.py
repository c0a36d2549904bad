"""Loops over tiles of LANES rows and columns of a matrix, whose numbers stand row by row, n to a row.

Which tiles is told by columns, a rising list of the first columns of tiles, of which `count`, or those from `first` up
to before `last`, are taken. A tile is named by its first row and its first column.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from rftsim.machine.lanes import (
    FUSED,
    LANES,
    VECTOR,
    WORD,
    add_product,
    data_of,
    load,
    number,
    place_of,
    shuffled,
    spread,
    store,
    zero_sum,
)

_INDEX: Final = ir.IntType(32)
_LEAST: Final = 1e-300
"""Size of the pivot that stands for a vanishing one."""
_ROWS: Final = range(LANES)


def _starts(builder: Any, row: Any, n: Any) -> list[Any]:
    """Where the rows of a tile's matrix start."""
    return [builder.mul(builder.add(row, number(k)), n) for k in _ROWS]


def _vectors(builder: Any, matrix: Any, starts: list[Any], column: Any) -> list[Any]:
    """The rows of a tile."""
    return [load(builder, matrix, builder.add(start, column)) for start in starts]


def _keep(builder: Any, rows: list[Any], matrix: Any, starts: list[Any], column: Any) -> None:
    """Store the rows of a tile."""
    for vector, start in zip(rows, starts, strict=True):
        store(builder, vector, matrix, builder.add(start, column))


@contextmanager
def _each(builder: Any, columns: Any, first: Any, last: Any) -> Iterator[Any]:
    """A loop over columns of a list."""
    with cgutils.for_range_slice(builder, first, last, number(1), WORD) as (index, _):
        yield builder.load(place_of(builder, columns, index))


def _add_tiles(builder: Any, matrix: Any, left: tuple[list[Any], Any], right: list[Any], sums: list[Any]) -> None:
    """Add the product of a tile in memory, its starts and its column, and one in registers."""
    starts, column = left
    for start, total in zip(starts, sums, strict=True):
        for k, vector in enumerate(right):
            place = builder.add(builder.add(start, column), number(k))
            add_product(builder, spread(builder, builder.load(place_of(builder, matrix, place))), vector, total)


def _negative(builder: Any, places: list[Any]) -> list[Any]:
    return [builder.fneg(builder.load(place)) for place in places]


def _across(builder: Any, sums: list[Any]) -> Any:
    """The sums over the lanes of four vectors, as one."""
    pairs = [
        builder.fadd(
            shuffled(builder, one, other, [0, 4, 2, 6]), shuffled(builder, one, other, [1, 5, 3, 7]), flags=("fast",)
        )
        for one, other in (sums[:2], sums[2:])
    ]
    low, high = (shuffled(builder, pairs[0], pairs[1], places) for places in ([0, 1, 4, 5], [2, 3, 6, 7]))
    return builder.fadd(low, high, flags=("fast",))


def _multiplying(plus: bool) -> Any:
    """Make the product of tiles and a vector, with that vector's own numbers added or without."""

    @intrinsic
    def multiply(
        typing_context: Any, columns: Any, first: Any, last: Any, a: Any, row: Any, n: Any, x: Any, out: Any
    ) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            places, matrix, vector, target = (data_of(context, builder, signature, arguments, k) for k in (0, 3, 6, 7))
            _, first, last, _, row, size, _, _ = arguments
            sums, starts = [zero_sum(builder) for _ in _ROWS], _starts(builder, row, size)
            with _each(builder, places, first, last) as column:
                factor = load(builder, vector, column)
                for start, total in zip(starts, sums, strict=True):
                    add_product(builder, load(builder, matrix, builder.add(start, column)), factor, total)
            found = _across(builder, [builder.load(total) for total in sums])
            if plus:
                found = builder.fadd(found, load(builder, vector, row))
            store(builder, found, target, row)

        return types.void(columns, types.intp, types.intp, a, types.intp, types.intp, x, out), generate

    return multiply


multiply = _multiplying(False)
"""Fill LANES numbers of out, from a row on, with the products of the tiles of that row and x."""
multiply_and_add = _multiplying(True)
"""The same, and the numbers of x themselves."""


@contextmanager
def _each_row(context: Any, builder: Any, signature: Any, arguments: Any) -> Iterator[Any]:
    """A loop over the rows of tiles, for functions that begin with columns, count, row and n: place, column."""
    columns, (_, count, row, n) = data_of(context, builder, signature, arguments, 0), arguments[:4]
    with _each(builder, columns, number(0), count) as column, cgutils.for_range(builder, number(LANES)) as each:
        yield builder.add(builder.mul(builder.add(row, each.index), n), column), column


@intrinsic
def clear(typing_context: Any, columns: Any, count: Any, row: Any, n: Any, out: Any) -> Any:
    """Set tiles of out to zero."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        target = data_of(context, builder, signature, arguments, 4)
        with _each_row(context, builder, signature, arguments) as (place, _):
            store(builder, ir.Constant(VECTOR, [0.0] * LANES), target, place)

    return types.void(columns, *[types.intp] * 3, out), generate


@intrinsic
def copy(typing_context: Any, columns: Any, count: Any, row: Any, n: Any, a: Any, out: Any) -> Any:
    """Copy tiles of a to out."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        matrix, target = (data_of(context, builder, signature, arguments, k) for k in (4, 5))
        with _each_row(context, builder, signature, arguments) as (place, _):
            store(builder, load(builder, matrix, place), target, place)

    return types.void(columns, *[types.intp] * 3, a, out), generate


@intrinsic
def add(typing_context: Any, columns: Any, count: Any, row: Any, n: Any, share: Any, a: Any, out: Any) -> Any:
    """Add a share of tiles of a to those of out."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        matrix, target = (data_of(context, builder, signature, arguments, k) for k in (5, 6))
        factor = spread(builder, arguments[4])
        with _each_row(context, builder, signature, arguments) as (place, _):
            product = builder.fmul(factor, load(builder, matrix, place), flags=FUSED)
            store(builder, builder.fadd(load(builder, target, place), product, flags=FUSED), target, place)

    return types.void(columns, *[types.intp] * 3, types.float64, a, out), generate


@intrinsic
def add_difference(
    typing_context: Any, columns: Any, count: Any, row: Any, n: Any, shares: Any, a: Any, b: Any, out: Any
) -> Any:
    """Add tiles of a less those of b, each column by a share, to those of out."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        factors, one, other, target = (data_of(context, builder, signature, arguments, k) for k in (4, 5, 6, 7))
        with _each_row(context, builder, signature, arguments) as (place, column):
            change = builder.fsub(load(builder, one, place), load(builder, other, place))
            product = builder.fmul(load(builder, factors, column), change, flags=FUSED)
            store(builder, builder.fadd(load(builder, target, place), product, flags=FUSED), target, place)

    return types.void(columns, *[types.intp] * 3, shares, a, b, out), generate


def _reduced(builder: Any, rows: list[Any], k: int) -> list[Any]:
    """The rows of a tile after one step of its inversion (Gauss and Jordan)."""
    pivot = builder.extract_element(rows[k], ir.Constant(_INDEX, k))
    is_zero = builder.fcmp_unordered("==", pivot, ir.Constant(pivot.type, 0.0))
    pivot = builder.select(is_zero, ir.Constant(pivot.type, _LEAST), pivot)
    inverse = spread(builder, builder.fdiv(ir.Constant(pivot.type, 1.0), pivot))
    own = builder.fmul(builder.insert_element(rows[k], ir.Constant(pivot.type, 1.0), ir.Constant(_INDEX, k)), inverse)
    reduced = []
    for i, row in enumerate(rows):
        share = shuffled(builder, row, row, [k] * LANES)
        rest = builder.insert_element(row, ir.Constant(pivot.type, 0.0), ir.Constant(_INDEX, k))
        product = builder.fmul(share, own, flags=FUSED)
        reduced.append(own if i == k else builder.fsub(rest, product, flags=FUSED))
    return reduced


@intrinsic
def invert(typing_context: Any, a: Any, row: Any, n: Any) -> Any:
    """Invert the tile on the diagonal of a at a row, in place, without a change of the order of its rows."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        matrix, starts = data_of(context, builder, signature, arguments, 0), _starts(builder, *arguments[1:])
        rows = _vectors(builder, matrix, starts, arguments[1])
        for k in reversed(_ROWS):
            rows = _reduced(builder, rows, k)
        _keep(builder, rows, matrix, starts, arguments[1])

    return types.void(a, types.intp, types.intp), generate


@intrinsic
def divide(typing_context: Any, a: Any, row: Any, column: Any, n: Any) -> Any:
    """Multiply a tile of a from the right by that on the diagonal of its columns, in place."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        matrix, (_, row, column, n) = data_of(context, builder, signature, arguments, 0), arguments
        starts, sums = _starts(builder, row, n), [zero_sum(builder) for _ in _ROWS]
        right = _vectors(builder, matrix, _starts(builder, column, n), column)
        _add_tiles(builder, matrix, (starts, column), right, sums)
        _keep(builder, [builder.load(total) for total in sums], matrix, starts, column)

    return types.void(a, *[types.intp] * 3), generate


@intrinsic
def eliminate(typing_context: Any, columns: Any, count: Any, a: Any, row: Any, pivot: Any, n: Any) -> Any:
    """Take from tiles of a row of a the product of that in column `pivot` and those of row `pivot` above them."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        places, matrix = (data_of(context, builder, signature, arguments, k) for k in (0, 2))
        _, count, _, row, pivot, n = arguments
        starts, others = _starts(builder, row, n), _starts(builder, pivot, n)
        sums = [zero_sum(builder) for _ in _ROWS]
        with _each(builder, places, number(0), count) as column:
            for total, vector in zip(sums, _vectors(builder, matrix, starts, column), strict=True):
                builder.store(builder.fneg(vector), total)
            _add_tiles(builder, matrix, (starts, pivot), _vectors(builder, matrix, others, column), sums)
            _keep(builder, _negative(builder, sums), matrix, starts, column)

    return types.void(columns, types.intp, a, *[types.intp] * 3), generate


@intrinsic
def close_above(typing_context: Any, columns: Any, first: Any, last: Any, a: Any, row: Any, column: Any, n: Any) -> Any:
    """Set a tile of a to its negative, less the products of those of its row and those of its column."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        places, matrix = (data_of(context, builder, signature, arguments, k) for k in (0, 3))
        _, first, last, _, row, column, n = arguments
        starts, sums = _starts(builder, row, n), [zero_sum(builder) for _ in _ROWS]
        for total, vector in zip(sums, _vectors(builder, matrix, starts, column), strict=True):
            builder.store(vector, total)
        with _each(builder, places, first, last) as between:
            right = _vectors(builder, matrix, _starts(builder, between, n), column)
            _add_tiles(builder, matrix, (starts, between), right, sums)
        _keep(builder, _negative(builder, sums), matrix, starts, column)

    return types.void(columns, types.intp, types.intp, a, *[types.intp] * 3), generate


@intrinsic
def close_below(typing_context: Any, columns: Any, first: Any, last: Any, a: Any, row: Any, column: Any, n: Any) -> Any:
    """Set a tile of a to the products of those of its row and those of its column, times that on its row's diagonal.

    The latter is taken negative, and from the left.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        places, matrix = (data_of(context, builder, signature, arguments, k) for k in (0, 3))
        _, first, last, _, row, column, n = arguments
        starts, sums = _starts(builder, row, n), [zero_sum(builder) for _ in _ROWS]
        with _each(builder, places, first, last) as between:
            right = _vectors(builder, matrix, _starts(builder, between, n), column)
            _add_tiles(builder, matrix, (starts, between), right, sums)
        totals = [zero_sum(builder) for _ in _ROWS]
        _add_tiles(builder, matrix, (starts, row), [builder.load(total) for total in sums], totals)
        _keep(builder, _negative(builder, totals), matrix, starts, column)

    return types.void(columns, types.intp, types.intp, a, *[types.intp] * 3), generate
