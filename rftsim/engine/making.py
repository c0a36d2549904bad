"""Making a block: the model's numbers are checked, and where they lie and how many they are is kept."""

from rftsim.engine import block, checks, instance, names, sound
from rftsim.engine.refusals import WHY
from rftsim.law.body import bed_at, header_at
from rftsim.law.layout import HEADER_NUMBERS, ruts_size
from rftsim.machine import claims
from rftsim.machine.compiling import exact
from rftsim.machine.memory import int32s, int64s, pointer


@exact
def initialise(model, data, m, d, number):
    """Make the block of an instance; what is wrong, see WHY, and the address of the name of what that is wrong with."""
    bodies, asked = instance.count_bodies(model, m, number), instance.asked_ruts(model, m, number)
    state_size = instance.granted_state(model, m, number) - asked
    words = block.state_start(bodies) // 8 + state_size
    place = claims.make(-1, d, number, words)
    if place < 0:
        return WHY.memory, instance.name(model, m, number)
    address = claims.address(place)
    blank = int64s(address, words)
    for i in range(words):
        blank[i] = 0
    start = int32s(pointer(m + model.plugin_stateadr), pointer(m + model.nplugin))[number]
    head = instance.head(address)
    head.state, head.state_size = pointer(d + data.plugin_state) + 8 * start, state_size
    head.ruts_size = asked
    why, whose = _check(model, m, number, address)
    if why != WHY.none:
        claims.drop(place)
    else:
        instance.slot(data, d, number)[0] = place
    return why, whose


@exact
def _check(model, m, number, address):
    """Fill a block's head and members; what is wrong with the model's numbers, and the address of a name."""
    nbody, text, head = pointer(m + model.nbody), pointer(m + model.names), instance.head(address)
    own = instance.name(model, m, number)
    head.bed, bed_name, why = checks.check_bed(model, m, own - text)
    if why != WHY.none:
        return why, own
    if not checks.sensors_fit(model, m, number):
        return WHY.sensor, own
    bed = instance.bed(model, m, address)
    if head.ruts_size != instance.ruts_of(model, m, number, ruts_size(bed_at(bed))):
        return WHY.state, own
    head.bed_weight = sound.sealed_weight(bed)
    if bed_at(bed).relief != 0.0:
        head.terrain, head.terrain_size = checks.check_terrain(model, m, own - text)
        if head.terrain < 0:
            return WHY.terrain, own
        head.terrain_weight = checks.weigh_shape(instance.terrain(model, m, address))
    plugins = int32s(pointer(m + model.body_plugin), nbody)
    for body in range(nbody):
        owner = names.start_of(model, m, model.name_bodyadr, nbody, body)
        if plugins[body] < 0 and checks.has_surface(model, m, owner):
            return WHY.plugin, text + owner
        if plugins[body] == number:
            if not _fill_member(model, m, address, body, owner, bed_name):
                return WHY.surface, text + owner
            head.nbody += 1
    return WHY.none, own


@exact
def _fill_member(model, m, address, body, owner, bed_name):
    """Fill the next member of a block; whether the body has the surface that was written for it."""
    start, size = checks.check_surface(model, m, owner, instance.head(address).bed, bed_name)
    if start < 0:
        return False
    member = instance.member(address, instance.head(address).nbody)
    at = pointer(m + model.numeric_data) + 8 * start
    member.body, member.start, member.size = body, start, size
    member.ntri, member.wheel_radius = header_at(at).ntri, header_at(at).wheel_radius
    member.header_weight, member.looked_at, member.weight_so_far = sound.weight(at, HEADER_NUMBERS), 0, 0.0
    while member.looked_at < member.size:
        sound.look(at, member)
    member.weight = sound.looked(member)
    member.read = _first_like(address, member, pointer(m + model.numeric_data))
    return True


@exact
def _first_like(address, member, numbers):
    """Where the surface of the first member lies that has the same numbers as a member's, which may be its own."""
    own = int64s(numbers + 8 * member.start, member.size)
    for k in range(instance.head(address).nbody):
        other = instance.member(address, k)
        if other.size != member.size or other.weight != member.weight:
            continue
        theirs, n = int64s(numbers + 8 * other.start, other.size), 0
        while n < own.size and own[n] == theirs[n]:
            n += 1
        if n == own.size:
            return other.start
    return member.start
