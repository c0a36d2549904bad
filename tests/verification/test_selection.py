"""What is looked at follows from the leading-edge rule, and a law reads the parameters that it says it reads."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rftsim import LAWS, PRESETS, FreeSurface
from rftsim.law import leading
from rftsim.law.frame import Frame
from rftsim.law.laws import RESPONSES
from rftsim.law.layout import BED, Medium, pack_bed, record
from rftsim.law.leading import SHARP, Edge
from rftsim.law.vectors import cross

RAMPS = (SHARP, 100.0, 5.0)
"""The rule as published, that of the implicit force, and a gentler one."""
TOLERANCES = (0.0, 1e-9, 1e-6)
ALWAYS = {"dynamic", "table"}
"""What every law may read of the sand, beside its parameters."""


def medium_of(law):
    """The sand as a law's stress reads it, as Python."""
    bed = record(pack_bed(PRESETS["poppy-seeds"], law, FreeSurface(), (0.0, 1.0, 0.0)), BED)
    table = tuple(tuple(row.tolist()) for row in bed.table)
    return Medium(*(table if name == "table" else float(bed[name]) for name in Medium._fields))


def law_of(response):
    """A dynamic law with a response: it has all terms."""
    return next(law for law in LAWS.values() if law.response is response and law.dynamic)


def unit(x):
    return tuple((np.array(x) / np.linalg.norm(x)).tolist())


vectors = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda x: np.linalg.norm(x) > 1e-3)
beside = st.floats(-12.0, 0.0).map(lambda x: 10.0**x)


def frame_of(up, aside):
    """A frame whose plane of motion is upright."""
    up = unit(up)
    plane = unit(cross(up, unit(aside)))
    still, upright = (0.0,) * 3, (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    return Frame(still, still, up, up, cross(plane, up), 0.0, (0.0,) * 4, 0.0, 0.0, still, upright, (0.0,) * 6)


@pytest.mark.parametrize("response", RESPONSES, ids=lambda response: response.reads[0] + str(RESPONSES.index(response)))
@given(
    normal=vectors,
    across=vectors,
    behind=beside,
    speed=st.floats(-6.0, 2.0),
    up=vectors,
    aside=vectors,
    ramp=st.sampled_from(RAMPS),
    tolerance=st.sampled_from(TOLERANCES),
)
def test_selection_drops_nothing_that_has_a_stress(response, normal, across, behind, speed, up, aside, ramp, tolerance):
    """Motions about the edge, n.v_hat from -1 to -1e-12: where `may_lead` is negative, there is no stress."""
    n, up = np.array(unit(normal)), unit(up)
    sideways = np.cross(n, across)
    if np.linalg.norm(sideways) < 1e-6 or np.linalg.norm(np.cross(up, aside)) < 1e-6:
        return
    v = 10.0**speed * (sideways / np.linalg.norm(sideways) - behind * n)
    frame, edge, velocity = frame_of(up, aside), Edge(tolerance, ramp), tuple(v.tolist())
    stress = response.stress(tuple(n.tolist()), velocity, up, frame, medium_of(law_of(response)), edge)
    score = leading.may_lead(response.normal_speed(tuple(n), velocity, frame), float(v @ v), leading.reach2(edge))
    if score < 0.0:
        assert not np.any(stress.per_depth)
        assert stress.inertia == 0.0


@pytest.mark.parametrize("tolerance", TOLERANCES)
def test_many_faces_lead_as_one_does(tolerance):
    """`leads` of arrays is `share` of each face under the rule as published."""
    rng = np.random.default_rng(2)
    normals, velocities = rng.normal(size=(2, 500, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    velocities[::5] = np.cross(normals, velocities)[::5]  # along the face
    cosines = (normals * velocities).sum(axis=1) / np.linalg.norm(velocities, axis=1)
    apart = np.abs(cosines + tolerance) > 1e-14
    one_by_one = [leading.share(cosine, 1.0, Edge(tolerance, SHARP)) > 0.5 for cosine in cosines[apart]]
    np.testing.assert_array_equal(leading.leads(normals, velocities, tolerance)[apart], one_by_one)
    assert 0 < sum(one_by_one) < len(one_by_one)


def test_selection_is_no_more_than_it_must_be():
    """A face a fifth of a radian behind the edge is passed over, under the published rule and the implicit force's."""
    v = (0.0, 0.0, -1.0)
    for ramp in RAMPS[:2]:
        n = (np.cos(0.2), 0.0, np.sin(0.2))
        assert leading.may_lead(np.dot(n, v), 1.0, leading.reach2(Edge(1e-9, ramp))) < 0.0


class Watched:
    """A medium that notes what is read of it."""

    def __init__(self, medium):
        self.medium, self.read = medium, set()

    def __getattr__(self, name):
        self.read.add(name)
        return getattr(self.medium, name)


@pytest.mark.parametrize("name", LAWS)
def test_a_law_reads_what_it_says(name):
    """No parameter beside those of `reads`, by a face that leads in the sand."""
    law = LAWS[name]
    medium, frame = Watched(medium_of(law)), frame_of((0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
    law.response.stress((0.6, 0.0, -0.8), (0.3, 0.1, -1.0), frame.up, frame, medium, Edge(1e-9, SHARP))
    law.response.felt_depth(0.1, medium)
    assert medium.read - ALWAYS == set(law.reads)


def test_what_a_law_reads_must_be_known():
    """A dynamic law on sand of unknown density is refused when it is packed."""
    with pytest.raises(ValueError, match="need the sand's density: give rho_c"):
        pack_bed(PRESETS["medium-sand"], LAWS["drft3d"], FreeSurface(), (0.0, 1.0, 0.0))


def test_a_law_without_machine_code_is_refused():
    """A response that is in no law of LAWS, which the compiled loops cannot know."""
    other = LAWS["rft3d"].response._replace(reads=("xi_n",))
    with pytest.raises(ValueError, match="no machine code was made for the law mine"):
        pack_bed(PRESETS["poppy-seeds"], LAWS["rft3d"]._replace(name="mine", response=other), FreeSurface(), (0, 1, 0))
