"""Checks of a model's numbers: of all when an instance is made, and at each step of what compiled code relies on."""

import numpy as np

from rftsim.engine import names
from rftsim.engine.block import (
    BODY_MARKER,
    CHUNK,
    MORE_MARKER,
    MORE_TERRAIN_MARKER,
    SAND_MARKER,
    TERRAIN_MARKER,
)
from rftsim.engine.refusals import WHY
from rftsim.engine.seal import (
    ANSWERS,
    COUNTS,
    FACTOR,
    LARGEST,
    LONGEST,
    PARAMETERS,
    REST,
    SEAL,
    SEAL_NUMBERS,
    SEALED,
    SHAPE,
    STEP,
    TINY,
    TOLERANCES,
    WEIGHED,
    WEIGHTS,
)
from rftsim.law.body import bed_at, header_at
from rftsim.law.field import terrain_at
from rftsim.law.layout import (
    BED_NUMBERS,
    BOX_NUMBERS,
    COLUMNS,
    HEADER_NUMBERS,
    TERRAIN_NUMBERS,
    WRENCH,
    packed_size,
    terrain_size,
)
from rftsim.machine.compiling import exact, inline, loop
from rftsim.machine.memory import doubles, int32s, peek, pointer, uint64s
from rftsim.machine.records import record_at

_BODY, _SAND, _TERRAIN = BODY_MARKER.encode(), SAND_MARKER.encode(), TERRAIN_MARKER.encode()
_MORE, _MORE_TERRAIN = MORE_MARKER.encode(), MORE_TERRAIN_MARKER.encode()
_STEP, _FACTOR = np.uint64(STEP), np.uint64(FACTOR)
_HALF, _PART, _PIECE = np.uint64(32), np.uint64(29), np.uint64(16)
_MASK, _NOTHING = np.uint64(0xFFFF), np.uint64(0)
_FIRST, _LAST = PARAMETERS[0], PARAMETERS[-1] + 1
_SEALED, _REST, _SHAPE = len(SEALED), len(REST), len(SHAPE)
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
    """A digest after one word more, and the key of that word."""
    key = key + _STEP
    return total + _mixed(word, key), key


@inline
def _word(numbers, words, k):
    """The bits of the k-th number."""
    return _NOTHING if abs(numbers[k]) < TINY else words[k]


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
    return int(seal.length) if 0.0 <= seal.length < LONGEST else 0


@exact
def find(model, m, marker, owner):
    """The numeric whose name is that at `owner` with a marker in it, that name, and where the marker stands; or -1."""
    text, count = names.text(model, m), pointer(m + model.nnumeric)
    for i in range(count):
        name = names.start_of(model, m, model.name_numericadr, count, i)
        at = names.marked(text, name, marker, owner, 0)
        if at >= 0:
            return i, name, at
    return -1, -1, -1


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
    numeric, name, at = find(model, m, _SAND, owner)
    start, size = _range(model, m, numeric)
    if size != BED_NUMBERS + SEAL_NUMBERS:
        return -1, owner, WHY.bed
    bed, text = pointer(m + model.numeric_data) + 8 * start, names.text(model, m)
    seal, numbers, words = _seal_at(bed + 8 * BED_NUMBERS), doubles(bed, BED_NUMBERS), uint64s(bed, BED_NUMBERS)
    total, key = _NOTHING, _NOTHING
    for k in range(_SEALED):
        total, key = _add(total, key, _word(numbers, words, SEALED[k]))
    while at >= 0:
        whole, _ = _add_text(total, key, text, owner + at, _length(seal))
        if _is_sealed(seal, whole):
            return start, owner + at, WHY.none if is_within(bed) else WHY.bounds
        at = names.marked(text, name, _SAND, owner, at + 1)
    return -1, owner, WHY.bed


@exact
def _total(address, end):
    """How many numbers the surface at an address has, seal and all, if its header can be one; else 0."""
    header = header_at(address)
    if not (1.0 <= header.ntri <= end and header.ntri == np.floor(header.ntri)):
        return 0
    return packed_size(header) + SEAL_NUMBERS


@exact
def _is_whole(model, m, numeric, start, total):
    """Whether so many numbers lie in the numerics from one on, one behind another."""
    for k in range((total + CHUNK - 1) // CHUNK):
        where, size = _range(model, m, numeric + k)
        if where != start + CHUNK * k or size != min(CHUNK, total - CHUNK * k):
            return False
    return True


@exact
def _goes_on(model, m, more, owner, numeric, at, total):
    """Whether those numerics have the names of what goes on so, and whose marker stands at a place of an owner's."""
    text, count = names.text(model, m), pointer(m + model.nnumeric)
    for k in range(1, (total + CHUNK - 1) // CHUNK):
        name = names.start_of(model, m, model.name_numericadr, count, numeric + k)
        if not names.goes_on(text, name, more, owner, at, k):
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
    numeric, name, at = find(model, m, _BODY, owner)
    start, size = _range(model, m, numeric)
    if size < _SMALLEST:
        return -1, 0
    numbers, text = pointer(m + model.numeric_data), names.text(model, m)
    surface = numbers + 8 * start
    total = _total(surface, pointer(m + model.nnumericdata))
    if total == 0 or not _is_whole(model, m, numeric, start, total):
        return -1, 0
    size = total - SEAL_NUMBERS
    seal, values, words = _seal_at(surface + 8 * size), doubles(surface, size), uint64s(surface, size)
    digest, key = _NOTHING, _NOTHING
    for k in range(size):
        digest, key = _add(digest, key, _word(values, words, k))
    of_bed = _length(_seal_at(numbers + 8 * (bed + BED_NUMBERS)))
    while at >= 0:
        whole, last = _add_text(digest, key, text, owner + at, _length(seal))
        whole, _ = _add_text(whole, last, text, bed_name, of_bed)
        if _is_sealed(seal, whole) and _goes_on(model, m, _MORE, owner, numeric, at, total):
            return start, size
        at = names.marked(text, name, _BODY, owner, at + 1)
    return -1, 0


@exact
def check_terrain(model, m, owner):
    """Where the terrain of the bed whose instance's name is at `owner` lies in numeric_data, and its size; else -1."""
    numeric, name, at = find(model, m, _TERRAIN, owner)
    start, size = _range(model, m, numeric)
    if size < TERRAIN_NUMBERS:
        return -1, 0
    terrain, text, end = (
        pointer(m + model.numeric_data) + 8 * start,
        names.text(model, m),
        pointer(m + model.nnumericdata),
    )
    head = terrain_at(terrain)
    if not (2.0 <= head.rows <= end and 2.0 <= head.columns <= end and head.rows * head.columns <= end):
        return -1, 0
    size = terrain_size(head)
    total = size + SEAL_NUMBERS
    if not _is_whole(model, m, numeric, start, total) or not are_numbers(terrain, size):
        return -1, 0
    seal, values, words = _seal_at(terrain + 8 * size), doubles(terrain, size), uint64s(terrain, size)
    digest, key = _NOTHING, _NOTHING
    for k in range(_SHAPE):
        digest, key = _add(digest, key, _word(values, words, SHAPE[k]))
    while at >= 0:
        whole, _ = _add_text(digest, key, text, owner + at, _length(seal))
        if _is_sealed(seal, whole) and _goes_on(model, m, _MORE_TERRAIN, owner, numeric, at, total):
            return start, size
        at = names.marked(text, name, _TERRAIN, owner, at + 1)
    return -1, 0


@exact
def has_surface(model, m, owner):
    """Whether there is a numeric with the surface of the body whose name is at `owner`."""
    return find(model, m, _BODY, owner)[0] >= 0


@exact
def sensors_fit(model, m, instance):
    """Whether each sensor of an instance has the numbers of a wrench in sensordata, and is of one of its bodies."""
    n, nbody, end = pointer(m + model.nsensor), pointer(m + model.nbody), pointer(m + model.nsensordata)
    owner, size = int32s(pointer(m + model.sensor_plugin), n), int32s(pointer(m + model.sensor_dim), n)
    start, body = int32s(pointer(m + model.sensor_adr), n), int32s(pointer(m + model.sensor_objid), n)
    plugins = int32s(pointer(m + model.body_plugin), nbody)
    for i in range(n):
        if owner[i] != instance:
            continue
        if size[i] != WRENCH or not 0 <= start[i] <= end - WRENCH:
            return False
        if not 0 <= body[i] < nbody or plugins[body[i]] != instance:
            return False
    return True


@loop
def are_numbers(address, size):
    """Whether so many numbers are finite."""
    total, numbers = 0.0, doubles(address, size)
    for i in range(size):
        total += 0.0 * numbers[i]
    return total == 0.0


@loop
def weigh(address, size):
    """The sum of so many numbers, each times a weight of its place, which what is moved or changed does not keep."""
    total, numbers, rows = 0.0, doubles(address, size), size // (4 * WEIGHED)
    for row in range(rows):  # four blocks at once: a weight is read once for all of them
        start, a, b, c, d = 4 * WEIGHED * row, 0.0, 0.0, 0.0, 0.0
        for k in range(WEIGHED):
            weight = WEIGHTS[k]
            a += weight * peek(numbers, start + k)
            b += weight * peek(numbers, start + k + WEIGHED)
            c += weight * peek(numbers, start + k + 2 * WEIGHED)
            d += weight * peek(numbers, start + k + 3 * WEIGHED)
        first = 1.0 + 4.0 * row * WEIGHTS[1]
        total += first * (a + b + c + d) + WEIGHTS[1] * (b + 2.0 * c + 3.0 * d)
    for block in range(4 * rows, (size + WEIGHED - 1) // WEIGHED):
        start, part = WEIGHED * block, 0.0
        for k in range(min(WEIGHED, size - start)):
            part += WEIGHTS[k] * peek(numbers, start + k)
        total += (1.0 + block * WEIGHTS[1]) * part
    return total


@exact
def weigh_shape(terrain):
    """The same of those numbers of the terrain at an address that nobody may change."""
    total, numbers = 0.0, doubles(terrain, TERRAIN_NUMBERS)
    for k in range(_SHAPE):
        total += numbers[SHAPE[k]] * WEIGHTS[k]
    return total


@exact
def weigh_rest(bed):
    """The same of those numbers of the bed at an address, beside its table, that nobody may change."""
    total, numbers = 0.0, doubles(bed, BED_NUMBERS)
    for k in range(_REST):
        total += numbers[REST[k]] * WEIGHTS[k]
    return total
