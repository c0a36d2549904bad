"""Loops over vectors of LANES numbers at once, for sizes that are multiples of it, where the optimiser's own are slow.

A loop of a dozen rounds that is made into vectors as it is written spends its time in what is left over at the end.
"""

from typing import Any, Final

from llvmlite import ir
from numba import config, types
from numba.core import cgutils
from numba.extending import intrinsic

from rftsim.machine.compiling import inline
from rftsim.machine.targets import AVX512

LANES: Final = 4
"""Numbers that are worked on at once; sizes that these functions are given are multiples of it."""
WIDE: Final = 2 * LANES if AVX512.name == config.CPU_NAME else LANES
"""The same of the widest vectors that the optimiser makes for the processor that is compiled for."""
FUSED: Final = ("contract",)
"""How products are added: fused, where the processor can."""
WORD: Final = ir.IntType(64)
VECTOR: Final = ir.VectorType(ir.DoubleType(), LANES)
"""Types of an index and of a vector."""


@inline
def padded(size):
    """The least multiple of LANES that is no less than a size."""
    return (size + LANES - 1) // LANES * LANES


def data_of(context: Any, builder: Any, signature: Any, arguments: Any, k: int) -> Any:
    """The pointer to the numbers of an argument that is an array."""
    return context.make_array(signature.args[k])(context, builder, arguments[k]).data


def place_of(builder: Any, data: Any, index: Any) -> Any:
    """The pointer to the number at an index."""
    return builder.gep(data, [index])


def load(builder: Any, data: Any, index: Any, lanes: int = LANES) -> Any:
    """So many numbers from an index on, as a vector."""
    place = builder.bitcast(place_of(builder, data, index), ir.VectorType(ir.DoubleType(), lanes).as_pointer())
    return builder.load(place, align=8)


def store(builder: Any, value: Any, data: Any, index: Any) -> None:
    """Write a vector from an index on."""
    builder.store(value, builder.bitcast(place_of(builder, data, index), value.type.as_pointer()), align=8)


def spread(builder: Any, number: Any, lanes: int = LANES) -> Any:
    """A vector that has one number in each of its lanes."""
    kind = ir.VectorType(number.type, lanes)
    first = builder.insert_element(ir.Constant(kind, ir.Undefined), number, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(first, first, ir.Constant(ir.VectorType(ir.IntType(32), lanes), [0] * lanes))


def shuffled(builder: Any, one: Any, other: Any, places: list[int]) -> Any:
    """The numbers of two vectors at given places, counted through both."""
    return builder.shuffle_vector(one, other, ir.Constant(ir.VectorType(ir.IntType(32), len(places)), places))


def zero_sum(builder: Any, lanes: int = LANES) -> Any:
    """Room for a sum of vectors, zero."""
    kind = ir.VectorType(ir.DoubleType(), lanes)
    place = cgutils.alloca_once(builder, kind)
    builder.store(ir.Constant(kind, [0.0] * lanes), place)
    return place


def add_product(builder: Any, one: Any, other: Any, place: Any) -> None:
    """Add the product of two vectors to what is at a place."""
    product = builder.fmul(one, other, flags=FUSED)
    builder.store(builder.fadd(builder.load(place), product, flags=FUSED), place)


def number(k: int) -> Any:
    """An index, as the code that is made takes it."""
    return ir.Constant(WORD, k)


def _places(builder: Any, size: Any) -> Any:
    """A loop over the first places of the vectors of so many numbers."""
    return cgutils.for_range_slice(builder, number(0), size, number(LANES), WORD)


@intrinsic
def combine_six(typing_context: Any, shares: Any, rows: Any, width: Any, out: Any) -> Any:
    """Fill out with the sum of six rows of a width, one behind another, each times its share."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        factors, matrix, target = (data_of(context, builder, signature, arguments, k) for k in (0, 1, 3))
        width = arguments[2]
        shares_at = [spread(builder, builder.load(place_of(builder, factors, number(k)))) for k in range(6)]
        starts = [builder.mul(number(k), width) for k in range(6)]
        with _places(builder, width) as (column, _):
            total = ir.Constant(shares_at[0].type, [0.0] * LANES)
            for factor, start in zip(shares_at, starts, strict=True):
                product = builder.fmul(factor, load(builder, matrix, builder.add(start, column)), flags=FUSED)
                total = builder.fadd(total, product, flags=FUSED)
            store(builder, total, target, column)

    return types.void(shares, rows, types.intp, out), generate


@intrinsic
def gather(typing_context: Any, places: Any, shares: Any, sixes: Any, count: Any, out: Any) -> Any:
    """Fill out with the sum of so many rows of six numbers, each times the share at the place that is given for it."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        indices, factors, rows, target = (data_of(context, builder, signature, arguments, k) for k in (0, 1, 2, 4))
        parts = [(number(0), LANES, zero_sum(builder)), (number(LANES), 2, zero_sum(builder, 2))]
        with cgutils.for_range(builder, arguments[3]) as row:
            index = builder.load(place_of(builder, indices, row.index))
            factor, first = builder.load(place_of(builder, factors, index)), builder.mul(row.index, number(6))
            for start, lanes, total in parts:
                numbers = load(builder, rows, builder.add(first, start), lanes)
                add_product(builder, spread(builder, factor, lanes), numbers, total)
        for start, _, total in parts:
            store(builder, builder.load(total), target, start)

    return types.void(places, shares, sixes, types.intp, out), generate


def picking(columns: int, stride: int) -> Any:
    """Make what copies those places of columns whose scores are not negative; out's columns are a stride apart."""
    flags, word = ir.VectorType(ir.IntType(1), WIDE), ir.IntType(WIDE)
    numbers, places = ir.VectorType(ir.DoubleType(), WIDE), ir.VectorType(WORD, WIDE)
    nothing, steps = ir.Constant(numbers, [0.0] * WIDE), ir.Constant(places, list(range(WIDE)))
    align = ir.Constant(ir.IntType(32), 8)

    def chosen(builder: Any, scores: Any, start: Any, count: Any) -> Any:
        """Which of the scores from a start on are not negative, of no more than a count; what is no number is not."""
        room = spread(builder, builder.sub(count, start), WIDE)
        inside = builder.icmp_signed("<", steps, room)
        return builder.and_(inside, builder.fcmp_unordered(">=", load(builder, scores, start, WIDE), nothing))

    @intrinsic
    def pick(
        typing_context: Any, scores: Any, count: Any, table: Any, first: Any, length: Any, out: Any, n: Any
    ) -> Any:
        """Pick of so many places of a table's columns, from one on, behind the n that out has; how many it has then.

        Behind these, up to WIDE - 1 numbers of each column are overwritten.
        """

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            at, source, target = (data_of(context, builder, signature, arguments, k) for k in (0, 2, 5))
            pointer, module = numbers.as_pointer(), builder.module
            fetch = cgutils.get_or_insert_function(
                module,
                ir.FunctionType(numbers, [pointer, align.type, flags, numbers]),
                f"llvm.masked.load.v{WIDE}f64.p0",
            )
            press = cgutils.get_or_insert_function(
                module,
                ir.FunctionType(numbers, [numbers, flags, numbers]),
                f"llvm.experimental.vector.compress.v{WIDE}f64",
            )
            found = cgutils.alloca_once_value(builder, arguments[6])
            with cgutils.for_range_slice(builder, number(0), arguments[1], number(WIDE), WORD) as (start, _):
                mask, behind = chosen(builder, at, start, arguments[1]), builder.load(found)
                for k in range(columns):
                    place = builder.add(builder.add(arguments[3], start), builder.mul(number(k), arguments[4]))
                    origin = builder.bitcast(place_of(builder, source, place), pointer)
                    values = builder.call(press, [builder.call(fetch, [origin, align, mask, nothing]), mask, nothing])
                    store(builder, values, target, builder.add(behind, number(k * stride)))
                more = builder.zext(builder.ctpop(builder.bitcast(mask, word)), WORD)
                builder.store(builder.add(behind, more), found)
            return builder.load(found)

        return types.intp(scores, types.intp, table, types.intp, types.intp, out, types.intp), generate

    return pick
