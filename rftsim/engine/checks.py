"""What is checked of a model's numbers: all when an instance is made, and at each step what compiled code relies on."""

import numpy as np

from rftsim.engine import names
from rftsim.engine.block import BODY_MARKER, CHUNK, SAND_MARKER
from rftsim.engine.refusals import WHY
from rftsim.engine.seal import (
    ANSWERS,
    BED_NUMBERS,
    COUNTS,
    FACTOR,
    LARGEST,
    PARAMETERS,
    SEAL,
    SEAL_NUMBERS,
    SEALED,
    STEP,
    TOLERANCES,
)
from rftsim.law.body import bed_at, header_at
from rftsim.law.layout import BOX_NUMBERS, COLUMNS, HEADER_NUMBERS, WRENCH, packed_size
from rftsim.machine.compiling import exact, inline, loop
from rftsim.machine.memory import doubles, int32s, int64s, pointer, uint64s
from rftsim.machine.records import record_at

_BODY, _SAND = BODY_MARKER.encode(), SAND_MARKER.encode()
_STEP, _FACTOR = np.uint64(STEP), np.uint64(FACTOR)
_HALF, _PART, _PIECE = np.uint64(32), np.uint64(29), np.uint64(16)
_MASK, _MINUS_ZERO, _NOTHING = np.uint64(0xFFFF), np.uint64(1 << 63), np.uint64(0)
_FIRST, _LAST = PARAMETERS[0], PARAMETERS[-1] + 1
_SEALED = len(SEALED)
_SMALLEST = HEADER_NUMBERS + COLUMNS + BOX_NUMBERS
_UNIT = 1e-5
"""How far the square of a unit vector may be from one: MuJoCo prints six digits."""

_seal_at = record_at(SEAL)


@inline
def _mixed(word, key):
    z = word + key
    z = (z ^ (z >> _HALF)) * _FACTOR
    return z ^ (z >> _PART)


@inline
def _add(total, key, word):
    """A digest after one word more, and the key of that word; zero counts as its negative does."""
    key = key + _STEP
    return total + _mixed(_NOTHING if word == _MINUS_ZERO else word, key), key


@exact
def _add_text(total, key, text, start, length):
    for i in range(length):
        total, key = _add(total, key, np.uint64(names.letter(text, start + i)))
    return total, key


@exact
def _is_digest(pieces, digest):
    same = True
    for k in range(4):
        same = same and pieces[k] == float((digest >> (_PIECE * np.uint64(k))) & _MASK)
    return same


@exact
def _is_sealed(seal, digest):
    """Whether a digest is that of the numbers as they were written, or as they are printed."""
    return _is_digest(seal.exact, digest) or _is_digest(seal.printed, digest)


@inline
def _length(seal):
    """Characters of an owner's name; none where that is no such number."""
    return int(seal.length) if 0.0 <= seal.length < 4096.0 else 0


@exact
def find(model, m, marker, owner):
    """The numeric whose name is that at `owner` with a marker in it, and where that stands; -1 where there is none."""
    text, count = names.text(model, m), pointer(m + model.nnumeric)
    for i in range(count):
        start = names.marked(text, names.start_of(model, m, model.name_numericadr, count, i), marker, owner)
        if start >= 0:
            return i, start
    return -1, -1


@exact
def _range(model, m, i):
    """Where a numeric starts in numeric_data, and its size; -1 where it is not in there, or there is none."""
    count, end = pointer(m + model.nnumeric), pointer(m + model.nnumericdata)
    if not 0 <= i < count:
        return -1, -1
    start = int(int32s(pointer(m + model.numeric_adr), count)[i])
    size = int(int32s(pointer(m + model.numeric_size), count)[i])
    return (start, size) if start >= 0 and 0 <= size <= end - start else (-1, -1)


@exact
def is_within(bed):
    """Whether the numbers at an address, which may be changed in place, are within the bounds of a bed."""
    record, numbers = bed_at(bed), doubles(bed, BED_NUMBERS)
    fine = 0.0 <= record.response < ANSWERS and record.response == np.floor(record.response)
    square = record.up[0] * record.up[0] + record.up[1] * record.up[1] + record.up[2] * record.up[2]
    fine = fine and abs(square - 1.0) <= _UNIT and record.up[2] > 0.0 and abs(record.offset) <= LARGEST
    fine = fine and TOLERANCES[0] <= record.tolerance <= TOLERANCES[1]
    fine = fine and COUNTS[0] <= record.iterations <= COUNTS[1] and record.iterations == np.floor(record.iterations)
    for k in range(_FIRST, _LAST):
        fine = fine and 0.0 <= numbers[k] <= LARGEST
    return fine


@exact
def check_bed(model, m, owner):
    """The bed whose instance's name is at `owner`.

    Returns:
        Its place in numeric_data, where its own name starts, and what is wrong with it, see WHY.
    """
    numeric, at = find(model, m, _SAND, owner)
    start, size = _range(model, m, numeric)
    if size != BED_NUMBERS + SEAL_NUMBERS:
        return -1, owner, WHY.bed
    bed = pointer(m + model.numeric_data) + 8 * start
    seal, words = _seal_at(bed + 8 * BED_NUMBERS), uint64s(bed, BED_NUMBERS)
    total, key = _NOTHING, _NOTHING
    for k in range(_SEALED):
        total, key = _add(total, key, words[SEALED[k]])
    total, key = _add_text(total, key, names.text(model, m), owner + at, _length(seal))
    if not _is_sealed(seal, total):
        return -1, owner, WHY.bed
    return start, owner + at, WHY.none if is_within(bed) else WHY.bounds


@exact
def _total(address, end):
    """How many numbers the surface at an address has, seal and all, if its header can be one; else 0."""
    header = header_at(address)
    if not (1.0 <= header.ntri <= end and header.ntri == np.floor(header.ntri)):
        return 0
    return packed_size(header) + SEAL_NUMBERS


@exact
def _is_whole(model, m, owner, numeric, at, start, total):
    """Whether the numerics from one on are those of a surface of so many numbers, one behind another."""
    text, count = names.text(model, m), pointer(m + model.nnumeric)
    for k in range((total + CHUNK - 1) // CHUNK):
        where, size = _range(model, m, numeric + k)
        if where != start + CHUNK * k or size != min(CHUNK, total - CHUNK * k):
            return False
        name = names.start_of(model, m, model.name_numericadr, count, numeric + k)
        if k > 0 and not names.goes_on(text, name, owner, at, k):
            return False
    return True


@exact
def check_surface(model, m, owner, bed, bed_name):
    """Where the surface of a body lies in numeric_data and its size, if it is the one that was written; else -1.

    Args:
        model: The offsets in mjModel.
        m: Address of the mjModel.
        owner: Where the body's name starts.
        bed: Place of the bed in numeric_data.
        bed_name: Where the bed's own name starts.
    """
    numeric, at = find(model, m, _BODY, owner)
    start, size = _range(model, m, numeric)
    if size < _SMALLEST:
        return -1, 0
    numbers = pointer(m + model.numeric_data)
    surface = numbers + 8 * start
    total = _total(surface, pointer(m + model.nnumericdata))
    if total == 0 or not _is_whole(model, m, owner, numeric, at, start, total):
        return -1, 0
    size = total - SEAL_NUMBERS
    seal, words = _seal_at(surface + 8 * size), uint64s(surface, size)
    digest, key = _NOTHING, _NOTHING
    for k in range(size):
        digest, key = _add(digest, key, words[k])
    text = names.text(model, m)
    digest, key = _add_text(digest, key, text, owner + at, _length(seal))
    digest, key = _add_text(digest, key, text, bed_name, _length(_seal_at(numbers + 8 * (bed + BED_NUMBERS))))
    return (start, size) if _is_sealed(seal, digest) else (-1, 0)


@exact
def has_surface(model, m, owner):
    """Whether there is a numeric with the surface of the body whose name is at `owner`."""
    return find(model, m, _BODY, owner)[0] >= 0


@exact
def sensors_have_room(model, m, instance):
    """Whether each sensor of an instance has the numbers of a wrench in sensordata."""
    n, end = pointer(m + model.nsensor), pointer(m + model.nsensordata)
    owner, size = int32s(pointer(m + model.sensor_plugin), n), int32s(pointer(m + model.sensor_dim), n)
    start = int32s(pointer(m + model.sensor_adr), n)
    for i in range(n):
        if owner[i] == instance and not (size[i] == WRENCH and 0 <= start[i] <= end - WRENCH):
            return False
    return True


@loop
def sum_of(address, size):
    """The sum of the bits of so many numbers, as integers that wrap round."""
    total, words = 0, int64s(address, size)
    for i in range(size):
        total += words[i]
    return total


@exact
def sealed_sum(bed):
    """The sum of the bits of the numbers of the bed at an address that nobody may change."""
    total, words = 0, int64s(bed, BED_NUMBERS)
    for k in range(_SEALED):
        total += words[SEALED[k]]
    return total
