"""Reductions remembered: from one load to the next, for bodies alike, and never against a file's will to mislead."""

import dataclasses
import os

import numpy as np
import pytest
from shapes import blob

from rftsim import PRESETS, FreeSurface
from rftsim.law.laws import get_law
from rftsim.law.layout import pack_bed
from rftsim.reduction import memory, reduce
from rftsim.reduction.measure import errors, scaled_wrenches
from rftsim.reduction.memory import Memory, user_folder
from rftsim.reduction.samples import DEPTHS, Reach, Samples, draw, free_reach
from rftsim.surface.triangles import Wheel

BED = pack_bed(PRESETS["poppy-seeds"], get_law("rft3d"), FreeSurface(), (0, 1, 0))
SURFACE = blob(np.random.default_rng(0), subdivisions=3)
TOLERANCE = 0.05


@pytest.fixture
def searches(monkeypatch):
    """Counts the searches that were made."""
    made = []

    def counted(*arguments):
        made.append(arguments)
        return reduce.partition(*arguments)

    monkeypatch.setattr(memory, "partition", counted)
    return made


def level(seed):
    """The reach of a body that cannot turn."""
    reach = free_reach(seed)
    return Reach(np.broadcast_to(np.eye(3), reach.rotations.shape), reach.motions)


def kept_file(folder):
    (path,) = folder.glob("*.npz")
    return path


def test_the_next_load_reads_what_the_last_one_found(tmp_path, searches):
    """Facets and errors are the same to the last bit, without a search."""
    folder = tmp_path / "of" / "mine"
    pair = [Memory(folder).reduced(SURFACE, BED, TOLERANCE) for _ in range(2)]
    assert len(searches) == 1
    assert pair[0][1] == pair[1][1] == reduce.reduced(SURFACE, BED, TOLERANCE)[1]
    np.testing.assert_array_equal(pair[0][0].triangles, pair[1][0].triangles)
    assert not list(folder.glob(".*"))


@pytest.mark.parametrize("what", ["triangles", "sand", "tolerance", "reach", "code"])
def test_another_problem_is_searched_anew(what, tmp_path, searches, monkeypatch):
    """All that a reduction depends on is in its name."""
    Memory(tmp_path).reduced(SURFACE, BED, TOLERANCE)
    surface, bed, tolerance, reach = SURFACE, BED, TOLERANCE, free_reach
    if what == "triangles":
        surface = SURFACE.moved(np.eye(3), (1e-6, 0, 0))
    elif what == "sand":
        bed = pack_bed(PRESETS["poppy-seeds"].replace(mu_surf=0.1), get_law("rft3d"), FreeSurface(), (0, 1, 0))
    elif what == "tolerance":
        tolerance = 0.06
    elif what == "reach":
        reach = level
    else:
        monkeypatch.setattr(memory, "_code", lambda: b"of tomorrow")
    Memory(tmp_path).reduced(surface, bed, tolerance, reach)
    assert len(searches) == 2


@pytest.mark.parametrize("law", ["rft3d", "rft2d", "drft3d"])
def test_a_mirror_image_is_not_searched(law, searches):
    """Its facets are the images of the other's, and err as much where the other's images are."""
    bed = pack_bed(PRESETS["poppy-seeds"], get_law(law), FreeSurface(), (0, 1, 0))
    mirror, shift, order = np.diag([1.0, -1.0, 1.0]), (0.01, 0.0, -0.02), np.random.default_rng(1)
    turned = (SURFACE.triangles @ mirror)[:, ::-1].astype(np.float32) + shift
    image = dataclasses.replace(SURFACE, triangles=order.permutation(turned))
    remembered = Memory(None)
    (facets, found), (other, same) = (remembered.reduced(one, bed, TOLERANCE) for one in (SURFACE, image))
    assert len(searches) == 1
    assert same == found
    samples = draw(SURFACE, bed, free_reach(0), DEPTHS, 0)
    turns = mirror @ samples.rotation @ mirror  # across the plane of motion
    velocity, omega, moved = samples.velocity @ mirror, -samples.omega @ mirror, turns @ shift
    position = samples.position @ mirror - moved
    reflected = Samples(samples.depth, position, turns, velocity - np.cross(omega, moved), omega)
    pair = [scaled_wrenches(one, bed, samples) for one in (SURFACE, facets)]
    images = [scaled_wrenches(one, bed, reflected) for one in (image, other)]
    error = errors(*pair, samples.depth).max()
    assert error == pytest.approx(found.error)
    assert errors(*images, samples.depth).max() == pytest.approx(error, rel=0.05)


def test_no_mirror_images_where_a_body_is_not_free(searches):
    """Left and right need not reach the same; nor is a wheel that turns the other way the same."""
    image = dataclasses.replace(SURFACE, triangles=(SURFACE.triangles * [1, -1, 1])[:, ::-1])
    remembered = Memory(None)
    for surface in (SURFACE, image):
        remembered.reduced(surface, BED, TOLERANCE, level)
    wheel = Wheel((0, 1, 0), (0, 0, 0), SURFACE.size / 2)
    for surface in (SURFACE, image):
        remembered.reduced(dataclasses.replace(surface, wheel=wheel), BED, TOLERANCE)
    assert len(searches) == 4


def truncated(path):
    path.write_bytes(path.read_bytes()[:-200])


def overwritten(path):
    path.write_bytes(b"no archive at all")


def changed_inside(path):
    found = bytearray(path.read_bytes())
    found[400] ^= 0xFF
    path.write_bytes(bytes(found))


def of_objects(path):
    np.savez(path, labels=np.array([{}], dtype=object), errors=np.zeros(2))


def of_another_shape(path):
    np.savez(path, labels=np.zeros(SURFACE.ntri - 1, dtype=np.uint32), errors=np.zeros(2))


def not_finite(path):
    np.savez(path, labels=np.zeros(SURFACE.ntri, dtype=np.uint32), errors=np.array([np.nan, 0.0]))


def with_gaps(path):
    labels = np.zeros(SURFACE.ntri, dtype=np.uint32)
    labels[0] = 2
    np.savez(path, labels=labels, errors=np.zeros(2))


def far_too_many(path):
    np.savez(path, labels=np.full(SURFACE.ntri, 2**32 - 1, dtype=np.uint32), errors=np.zeros(2))


def linked(path):
    path.rename(path.with_suffix(".elsewhere"))
    path.symlink_to(path.with_suffix(".elsewhere"))


def folder_instead(path):
    path.unlink()
    path.mkdir()


BROKEN = [
    truncated,
    overwritten,
    changed_inside,
    of_objects,
    of_another_shape,
    not_finite,
    with_gaps,
    far_too_many,
    linked,
    folder_instead,
]


@pytest.mark.parametrize("broken", BROKEN)
def test_a_broken_file_is_made_anew(broken, tmp_path, searches):
    """Whatever lies there: the result is that of a search, and no error."""
    first = Memory(tmp_path).reduced(SURFACE, BED, TOLERANCE)
    broken(kept_file(tmp_path))
    again = Memory(tmp_path).reduced(SURFACE, BED, TOLERANCE)
    assert len(searches) == 2
    np.testing.assert_array_equal(first[0].triangles, again[0].triangles)
    if broken is not folder_instead:
        Memory(tmp_path).reduced(SURFACE, BED, TOLERANCE)
        assert len(searches) == 2


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="files have no owner here")
def test_a_file_of_another_user_is_not_read(tmp_path, searches, monkeypatch):
    """Nobody else decides what a body feels."""
    Memory(tmp_path).reduced(SURFACE, BED, TOLERANCE)
    own = os.geteuid()
    monkeypatch.setattr(os, "geteuid", lambda: own + 1)
    Memory(tmp_path).reduced(SURFACE, BED, TOLERANCE)
    assert len(searches) == 2


def test_where_nothing_can_be_written_nothing_is_kept(tmp_path, searches):
    """A file in the folder's place, or no folder, costs the search and nothing else."""
    (tmp_path / "file").write_text("")
    for folder in (tmp_path / "file", tmp_path / "file" / "below", None):
        assert Memory(folder).reduced(SURFACE, BED, TOLERANCE)[1].elements < SURFACE.ntri
    assert len(searches) == 3


def test_old_files_are_deleted(tmp_path, monkeypatch):
    """Of more than so many the older half goes."""
    monkeypatch.setattr(memory, "MOST", 4)
    for age in range(4):
        path = tmp_path / f"{age}.npz"
        path.write_bytes(b"")
        os.utime(path, (age, age))
    Memory(tmp_path).reduced(SURFACE, BED, TOLERANCE)
    assert {path.stem for path in tmp_path.glob("?.npz")} == {"2", "3"}


def test_the_folder_is_where_the_user_wants_it(monkeypatch, tmp_path):
    """XDG_CACHE_HOME counts where it is absolute."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert user_folder() == tmp_path / "rftsim" / "reduced"
    monkeypatch.setenv("XDG_CACHE_HOME", "nowhere")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert tmp_path in user_folder().parents
