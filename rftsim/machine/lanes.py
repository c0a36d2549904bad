"""Loops over vectors of LANES numbers at once, for sizes that are multiples of it, where the optimiser's own are slow.

A loop of a dozen rounds that is made into vectors as it is written spends its time in what is left over at the end.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from rftsim.machine.compiling import inline

LANES: Final = 4
"""Numbers that are worked on at once; sizes that these functions are given are multiples of it."""
_FUSED: Final = ("contract",)
_WORD: Final = ir.IntType(64)


@inline
def padded(size):
    """The least multiple of LANES that is no less than a size."""
    return (size + LANES - 1) // LANES * LANES


def _data(context: Any, builder: Any, signature: Any, arguments: Any, k: int) -> Any:
    return context.make_array(signature.args[k])(context, builder, arguments[k]).data


def _at(builder: Any, data: Any, index: Any) -> Any:
    return builder.gep(data, [index])


def _load(builder: Any, data: Any, index: Any, lanes: int = LANES) -> Any:
    """So many numbers from an index on, as a vector."""
    place = builder.bitcast(_at(builder, data, index), ir.VectorType(ir.DoubleType(), lanes).as_pointer())
    return builder.load(place, align=8)


def _store(builder: Any, value: Any, data: Any, index: Any) -> None:
    builder.store(value, builder.bitcast(_at(builder, data, index), value.type.as_pointer()), align=8)


def _spread(builder: Any, number: Any, lanes: int = LANES) -> Any:
    """A vector of one number."""
    kind = ir.VectorType(number.type, lanes)
    first = builder.insert_element(ir.Constant(kind, ir.Undefined), number, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(first, first, ir.Constant(ir.VectorType(ir.IntType(32), lanes), [0] * lanes))


def _shuffled(builder: Any, one: Any, other: Any, places: list[int]) -> Any:
    return builder.shuffle_vector(one, other, ir.Constant(ir.VectorType(ir.IntType(32), len(places)), places))


def _sum(builder: Any, lanes: int = LANES) -> Any:
    """Room for a sum of vectors, zero."""
    kind = ir.VectorType(ir.DoubleType(), lanes)
    place = cgutils.alloca_once(builder, kind)
    builder.store(ir.Constant(kind, [0.0] * lanes), place)
    return place


def _add_product(builder: Any, one: Any, other: Any, place: Any) -> None:
    product = builder.fmul(one, other, flags=_FUSED)
    builder.store(builder.fadd(builder.load(place), product, flags=_FUSED), place)


def _number(k: int) -> Any:
    return ir.Constant(_WORD, k)


def _places(builder: Any, size: Any) -> Any:
    """A loop over the first places of the vectors of so many numbers."""
    return cgutils.for_range_slice(builder, _number(0), size, _number(LANES), _WORD)


@intrinsic
def multiply(typing_context: Any, a: Any, x: Any, n: Any, out: Any) -> Any:
    """Fill out with the product A x of a matrix (n, n), row by row in memory."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        matrix, vector, target = (_data(context, builder, signature, arguments, k) for k in (0, 1, 3))
        size = arguments[2]
        with _places(builder, size) as (row, _):
            sums = [_sum(builder) for _ in range(LANES)]
            starts = [builder.mul(builder.add(row, _number(k)), size) for k in range(LANES)]
            with _places(builder, size) as (column, _):
                factor = _load(builder, vector, column)
                for start, total in zip(starts, sums, strict=True):
                    _add_product(builder, _load(builder, matrix, builder.add(start, column)), factor, total)
            _store(builder, _across(builder, [builder.load(total) for total in sums]), target, row)

    return types.void(a, x, types.intp, out), generate


def _across(builder: Any, sums: list[Any]) -> Any:
    """The sums over the lanes of four vectors, as one."""
    pairs = [
        builder.fadd(
            _shuffled(builder, one, other, [0, 4, 2, 6]), _shuffled(builder, one, other, [1, 5, 3, 7]), flags=("fast",)
        )
        for one, other in (sums[:2], sums[2:])
    ]
    low, high = (_shuffled(builder, *pairs, places) for places in ([0, 1, 4, 5], [2, 3, 6, 7]))
    return builder.fadd(low, high, flags=("fast",))


@intrinsic
def combine_six(typing_context: Any, shares: Any, rows: Any, width: Any, out: Any) -> Any:
    """Fill out with the sum of six rows of a width, one behind another, each times its share."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        factors, matrix, target = (_data(context, builder, signature, arguments, k) for k in (0, 1, 3))
        width = arguments[2]
        spread = [_spread(builder, builder.load(_at(builder, factors, _number(k)))) for k in range(6)]
        starts = [builder.mul(_number(k), width) for k in range(6)]
        with _places(builder, width) as (column, _):
            total = ir.Constant(spread[0].type, [0.0] * LANES)
            for factor, start in zip(spread, starts, strict=True):
                product = builder.fmul(factor, _load(builder, matrix, builder.add(start, column)), flags=_FUSED)
                total = builder.fadd(total, product, flags=_FUSED)
            _store(builder, total, target, column)

    return types.void(shares, rows, types.intp, out), generate


@intrinsic
def add_scaled(typing_context: Any, share: Any, x: Any, start: Any, n: Any, out: Any, at: Any) -> Any:
    """Add a share of n numbers of x, from a start on, to those of out from a place on."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        vector, target = (_data(context, builder, signature, arguments, k) for k in (1, 4))
        factor = _spread(builder, arguments[0])
        with _places(builder, arguments[3]) as (k, _):
            place = builder.add(arguments[5], k)
            product = builder.fmul(factor, _load(builder, vector, builder.add(arguments[2], k)), flags=_FUSED)
            _store(builder, builder.fadd(_load(builder, target, place), product, flags=_FUSED), target, place)

    return types.void(types.float64, x, types.intp, types.intp, out, types.intp), generate


def _set(builder: Any, numbers: Any, place: Any, value: float) -> Any:
    """A vector with one of its numbers replaced, where the place is one of it.

    A number that was written alone to memory would have the vector that is then read there wait for it.
    """
    kind = ir.VectorType(_WORD, LANES)
    own = builder.icmp_signed("==", _spread(builder, place), ir.Constant(kind, list(range(LANES))))
    return builder.select(own, ir.Constant(numbers.type, [value] * LANES), numbers)


@intrinsic
def add_to_rows(
    typing_context: Any, shares: Any, rows: Any, count: Any, a: Any, start: Any, n: Any, column: Any, k: Any
) -> Any:
    """Add LANES numbers from a column on, of the row that starts at one place of a, to so many rows, each by a share.

    What those have in column k is taken for zero. Rows are of n numbers.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        factors, indices, matrix = (_data(context, builder, signature, arguments, k) for k in (0, 1, 3))
        _, _, count, _, start, size, column, cleared = arguments
        numbers, lane = _load(builder, matrix, builder.add(start, column)), builder.sub(cleared, column)
        with cgutils.for_range(builder, count) as each:
            row = builder.mul(builder.load(_at(builder, indices, each.index)), size)
            place, factor = builder.add(row, column), builder.load(_at(builder, factors, each.index))
            product = builder.fmul(_spread(builder, factor), numbers, flags=_FUSED)
            known = _set(builder, _load(builder, matrix, place), lane, 0.0)
            _store(builder, builder.fadd(known, product, flags=_FUSED), matrix, place)

    return types.void(shares, rows, types.intp, a, *[types.intp] * 4), generate


@intrinsic
def combine_rows(
    typing_context: Any, shares: Any, rows: Any, ends: Any, a: Any, n: Any, column: Any, k: Any, weight: Any
) -> Any:
    """Fill LANES numbers of row k of a, from a column on, with the sum of those of others, each by a share, weighted.

    Row k itself adds a one in column k. `ends` says from which of the others on, and up to which; rows are of n.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        factors, indices, matrix = (_data(context, builder, signature, arguments, k) for k in (0, 1, 3))
        _, _, ends, _, size, column, own, weight = arguments
        first, last = builder.extract_value(ends, 0), builder.extract_value(ends, 1)
        total = _sum(builder)
        with cgutils.for_range_slice(builder, first, last, _number(1), _WORD) as (index, _):
            row = builder.mul(builder.load(_at(builder, indices, index)), size)
            factor = _spread(builder, builder.load(_at(builder, factors, index)))
            _add_product(builder, factor, _load(builder, matrix, builder.add(row, column)), total)
        known = _set(builder, builder.load(total), builder.sub(own, column), 1.0)
        place = builder.add(builder.mul(own, size), column)
        _store(builder, builder.fmul(_spread(builder, weight), known), matrix, place)

    pair = types.UniTuple(types.intp, 2)
    return types.void(shares, rows, pair, a, *[types.intp] * 3, types.float64), generate


def _each(builder: Any, columns: Any, count: Any) -> Any:
    """A loop over so many columns of a list."""

    @contextmanager
    def loop() -> Iterator[Any]:
        with cgutils.for_range(builder, count) as each:
            yield builder.load(_at(builder, columns, each.index))

    return loop()


@intrinsic
def multiply_at(typing_context: Any, columns: Any, count: Any, a: Any, row: Any, n: Any, x: Any, out: Any) -> Any:
    """Fill LANES numbers of out with the products of as many rows of a, of n numbers, and x, from a row on.

    LANES columns from each of so many on are read, no others.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        places, matrix, vector, target = (_data(context, builder, signature, arguments, k) for k in (0, 2, 5, 6))
        _, count, _, row, size, _, _ = arguments
        sums = [_sum(builder) for _ in range(LANES)]
        starts = [builder.mul(builder.add(row, _number(k)), size) for k in range(LANES)]
        with _each(builder, places, count) as column:
            factor = _load(builder, vector, column)
            for start, total in zip(starts, sums, strict=True):
                _add_product(builder, _load(builder, matrix, builder.add(start, column)), factor, total)
        _store(builder, _across(builder, [builder.load(total) for total in sums]), target, row)

    return types.void(columns, types.intp, a, types.intp, types.intp, x, out), generate


@intrinsic
def dot_at(typing_context: Any, columns: Any, count: Any, a: Any, start: Any, x: Any) -> Any:
    """The scalar product of x and a row of a that starts at a place, of LANES columns from each of so many on."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        places, matrix, vector = (_data(context, builder, signature, arguments, k) for k in (0, 2, 4))
        total = _sum(builder)
        with _each(builder, places, arguments[1]) as column:
            numbers = _load(builder, matrix, builder.add(arguments[3], column))
            _add_product(builder, numbers, _load(builder, vector, column), total)
        numbers = builder.load(total)
        halves = [_shuffled(builder, numbers, numbers, places) for places in ([0, 1], [2, 3])]
        both = builder.fadd(*halves, flags=("fast",))
        ends = [builder.extract_element(both, ir.Constant(ir.IntType(32), k)) for k in range(2)]
        return builder.fadd(*ends, flags=("fast",))

    return types.float64(columns, types.intp, a, types.intp, x), generate


@intrinsic
def add_at(typing_context: Any, share: Any, columns: Any, count: Any, a: Any, start: Any, out: Any, at: Any) -> Any:
    """Add a share of a row of a to one of out, which start at two places, in LANES columns from each of so many on."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        places, matrix, target = (_data(context, builder, signature, arguments, k) for k in (1, 3, 5))
        factor = _spread(builder, arguments[0])
        with _each(builder, places, arguments[2]) as column:
            place = builder.add(arguments[6], column)
            product = builder.fmul(factor, _load(builder, matrix, builder.add(arguments[4], column)), flags=_FUSED)
            _store(builder, builder.fadd(_load(builder, target, place), product, flags=_FUSED), target, place)

    return types.void(types.float64, columns, types.intp, a, types.intp, out, types.intp), generate


@intrinsic
def add_difference_at(
    typing_context: Any, shares: Any, columns: Any, count: Any, a: Any, b: Any, start: Any, out: Any
) -> Any:
    """Add a row of a less that of b to that of out, each column by a share, in LANES columns from each of so many on."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        factors, places, one, other, target = (
            _data(context, builder, signature, arguments, k) for k in (0, 1, 3, 4, 6)
        )
        with _each(builder, places, arguments[2]) as column:
            place = builder.add(arguments[5], column)
            change = builder.fsub(_load(builder, one, place), _load(builder, other, place))
            product = builder.fmul(_load(builder, factors, column), change, flags=_FUSED)
            _store(builder, builder.fadd(_load(builder, target, place), product, flags=_FUSED), target, place)

    return types.void(shares, columns, types.intp, a, b, types.intp, out), generate


@intrinsic
def copy_at(typing_context: Any, columns: Any, count: Any, a: Any, start: Any, out: Any) -> Any:
    """Copy a row of a, which starts at a place, to the same place of out, in LANES columns from each of so many on."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        places, matrix, target = (_data(context, builder, signature, arguments, k) for k in (0, 2, 4))
        with _each(builder, places, arguments[1]) as column:
            place = builder.add(arguments[3], column)
            _store(builder, _load(builder, matrix, place), target, place)

    return types.void(columns, types.intp, a, types.intp, out), generate


@intrinsic
def clear_at(typing_context: Any, columns: Any, count: Any, out: Any, start: Any) -> Any:
    """Set a row of out, which starts at a place, to zero in LANES columns from each of so many on."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        places, target = (_data(context, builder, signature, arguments, k) for k in (0, 2))
        nothing = ir.Constant(ir.VectorType(ir.DoubleType(), LANES), [0.0] * LANES)
        with _each(builder, places, arguments[1]) as column:
            _store(builder, nothing, target, builder.add(arguments[3], column))

    return types.void(columns, types.intp, out, types.intp), generate


@intrinsic
def scale(typing_context: Any, share: Any, out: Any, at: Any, n: Any, k: Any) -> Any:
    """Multiply n numbers of out, from a place on, in place; the k-th is taken for one."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        target, factor = _data(context, builder, signature, arguments, 1), _spread(builder, arguments[0])
        with _places(builder, arguments[3]) as (column, _):
            place = builder.add(arguments[2], column)
            known = _set(builder, _load(builder, target, place), builder.sub(arguments[4], column), 1.0)
            _store(builder, builder.fmul(factor, known), target, place)

    return types.void(types.float64, out, types.intp, types.intp, types.intp), generate


@intrinsic
def gather(typing_context: Any, places: Any, shares: Any, sixes: Any, count: Any, out: Any) -> Any:
    """Fill out with the sum of so many rows of six numbers, each times the share at the place that is given for it."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        indices, factors, rows, target = (_data(context, builder, signature, arguments, k) for k in (0, 1, 2, 4))
        parts = [(_number(0), LANES, _sum(builder)), (_number(LANES), 2, _sum(builder, 2))]
        with cgutils.for_range(builder, arguments[3]) as row:
            index = builder.load(_at(builder, indices, row.index))
            factor, first = builder.load(_at(builder, factors, index)), builder.mul(row.index, _number(6))
            for start, lanes, total in parts:
                numbers = _load(builder, rows, builder.add(first, start), lanes)
                _add_product(builder, _spread(builder, factor, lanes), numbers, total)
        for start, _, total in parts:
            _store(builder, builder.load(total), target, start)

    return types.void(places, shares, sixes, types.intp, out), generate
