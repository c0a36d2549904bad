"""Files and arguments that once broke a command, and others drawn at random: refused in one line, or read rightly."""

import json
import os
import signal
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from test_cli import call

from rftsim.errors import RftsimError, RftsimNote, RftsimWarning
from rftsim.files import Kept, replacing
from rftsim.fit import trials as plate_trials
from rftsim.fit.columns import read_columns
from rftsim.fit.estimate import estimate
from rftsim.sand.medium import ALPHA_Z_PLATE, Sand
from rftsim.sand.presets import make_sand
from rftsim.surface.triangles import load_surface

MODEL = (
    '<mujoco><option timestep="%s"/><worldbody><geom type="plane" size="1 1 1"/><body pos="0 0 .1"><freejoint/>'
    '<geom type="sphere" size=".05"/></body></worldbody></mujoco>'
)
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 %s\nf 1 2 3\n"
PLATE = ("fit", "plate", "FILE", "--area", "0.01")
FORCE = ("force", "FILE", "--velocity", "0", "0", "-1")
RUN = ("run", "FILE", "--duration", "0.01")
SAND = ("run", "intruder", "--duration", "0.01", "--sand", "FILE")
MAP = ("fit", "map", "FILE", "--mu-surf")
BROKE = [
    ("zero.xml", MODEL % 0, RUN, "the timestep must be positive"),
    ("backwards.xml", MODEL % -0.01, RUN, "the timestep must be positive"),
    ("short.xml", MODEL % 1e-300, RUN, "the timestep must be 1e-09 s or more"),
    ("number.toml", "sand = 3\n", SAND, "needs a table [sand]"),
    ("truth.toml", "xi_n = true\n", SAND, "xi_n must be a number, not True"),
    ("digits.toml", f"xi_n = 1{'0' * 400}\n", SAND, "xi_n must be finite"),
    ("source.toml", "xi_n = 1e6\nsource = 3\n", SAND, "source must be text"),
    ("deep.toml", "a = " + "[" * 5000, SAND, "nested too deeply"),
    ("long.csv", "depth,force\n1,1\n" + "1" * 131_073 + ",2\n", PLATE, "line 3, is no row of entries"),
    ("quote.csv", 'depth,force\n1,"1\n' + "2,2\n" * 60_000, PLATE, "is no row of entries"),
    ("zeros.csv", "depth,force\n1,1\0\n", PLATE, "zero bytes"),
    ("wide.csv", "depth,force\n0,01,3,5\n", PLATE, "line 2, has 4 entries under 2 headings"),
    ("grouped.csv", "depth;force\n1,234;2,345\n", PLATE, "the comma of '1,234' may be decimal or not"),
    ("mixed.csv", "depth;force\n0,02;1.234\n", PLATE, "beside '1.234' may be decimal or not"),
    ("unit.csv", "depth [mm],force\n10,1\n", PLATE, "depth is in [mm]; give it in m"),
    ("twice.csv", "depth,Depth,force\n1,1,1\n", PLATE, "2 columns 'depth'"),
    ("packed.csv", "PK\3\4", PLATE, "save the spreadsheet as CSV"),
    ("alike.csv", "depth,force\n" + "0.1,100\n" * 9, PLATE, "9 rows, of which 1 differ"),
    (
        "inf.csv",
        "beta,gamma,alpha_x,alpha_y,alpha_z\n0,90,0,0,1e6\n",
        (*MAP, "inf"),
        "mu_surf must be finite",
    ),
    ("nan.obj", TRIANGLE % "nan", FORCE, "not finite"),
    ("far.obj", TRIANGLE % "1e308", (*FORCE, "--allow-open"), "1e+308 m from its origin"),
    ("half.3mf", "PK\3\4", FORCE, "cannot read the mesh"),
    ("packed.stl", "\x1f\x8b", FORCE, "unpack it first"),
]
"""Name and content of each file, the command that reads it, and words of its error."""


@pytest.mark.parametrize(("name", "content", "command", "words"), BROKE, ids=[name for name, *_ in BROKE])
def test_files_that_once_broke_something(capsys, tmp_path, name, content, command, words):
    path = tmp_path / name
    path.write_bytes(content.encode("latin-1"))
    code, out, err = call(capsys, *(path if word == "FILE" else word for word in command))
    assert (code, out) == (2, "")
    assert len(err.splitlines()) == 1
    assert words in err
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("run", "intruder", "--duration", "1e308"), "1e+308 s are more than 1e+09 time steps"),
        (("drop", "MODEL", "--limit", "1e300"), "more than 1e+09 time steps"),
        *(((*FORCE[:1], "MESH", "--velocity", x, "0", "-1"), "velocity must be three finite") for x in ("nan", "inf")),
        ((*FORCE[:1], "MESH", *FORCE[2:], "--position", "0", "nan", "0"), "position must be three finite"),
        ((*FORCE[:1], "MESH", *FORCE[2:], "--angular-velocity", "inf", "0", "0"), "angular_velocity must be three"),
        ((*FORCE[:1], "MESH", *FORCE[2:], "--plane", "0", "nan", "0"), "plane must be three finite"),
        ((*FORCE[:1], "MESH", *FORCE[2:], "--scale", "1e300"), "m from its origin"),
        (("fit", "drag", "x.csv", "--rho-c", "inf"), "rho_c must be positive"),
        (("fit", "plate", "x.csv", "--area", "inf"), "area must be positive"),
        (("fit", "map", "x.csv", "--mu-surf", "0.4", "--prior", "inf"), "prior must be zero or more"),
        (("fit", "map", "x.csv", "--rho-c", "nan"), "rho_c must be finite"),
        (("runn",), "Unrecognized options: runn"),
        (("run",), "Missing from rftsim run"),
        (("force", "a.stl", "--velocity", "0", "0", "x"), "Error parsing --velocity"),
    ],
)
def test_arguments_that_cannot_be(capsys, tmp_path, monkeypatch, arguments, words):
    (tmp_path / "model.xml").write_text(MODEL % 0.002)
    trimesh.creation.box((0.1, 0.1, 0.1)).export(tmp_path / "box.stl")
    monkeypatch.chdir(tmp_path)
    code, out, err = call(capsys, *({"MODEL": "model.xml", "MESH": "box.stl"}.get(word, word) for word in arguments))
    assert (code, out) == (2, "")
    assert len(err.splitlines()) == 1
    assert words in err
    assert len(list(tmp_path.iterdir())) == 2


@pytest.mark.parametrize(
    ("head", "separator", "encoding", "comma"),
    [
        ("depth,force", ",", "utf-8-sig", False),
        ("Depth [m];FORCE (N)", ";", "utf-8", True),
        ("depth\tforce", "\t", "utf-16", True),
        ("force,depth", ",", "utf-8", False),
        ('"depth [m]","force"', ",", "cp1252", False),
    ],
)
def test_spreadsheets_as_programs_write_them(tmp_path, head, separator, encoding, comma):
    """The same plate in each form: F = 0.87574 xi_n A z with xi_n = 1e6 and A = 0.01."""
    depth = np.array([0.01, 0.02, 0.035, 0.05])
    force = ALPHA_Z_PLATE * 1e4 * depth
    columns = (force, depth) if head.startswith("force") else (depth, force)
    rows = [separator.join(map(repr, row)) for row in np.column_stack(columns).tolist()]
    text = "\n".join([head, *(row.replace(".", ",") if comma else row for row in rows), ""])
    (tmp_path / "plate.csv").write_bytes(text.encode(encoding))
    found = plate_trials.pushed(tmp_path / "plate.csv", 0.01)
    assert found.parameters["xi_n"] == pytest.approx(1e6, rel=1e-12)


def test_columns_that_are_not_read_are_said(tmp_path):
    path = tmp_path / "plate.csv"
    path.write_text("depth,Kraft,force,time [s]\n1,2,3,4\n")
    with pytest.warns(RftsimNote, match=r"not read: Kraft, time \[s\]"):
        assert read_columns(path, ("depth", "force"))["force"].tolist() == [3.0]


def test_readings_that_repeat_tell_no_spread():
    """Nine readings of one value have an interval of no width; those that repeat in part are doubtful."""
    with pytest.raises(RftsimError, match="9 rows, of which 1 differ"):
        estimate(np.full((9, 1), 0.1), np.full(9, 5.0))
    x = np.repeat([1.0, 2.0, 3.0], 2)
    with pytest.warns(RftsimWarning, match="3 of 6 rows repeat"):
        estimate(x[:, None], 2.0 * x + np.repeat([0.1, -0.1, 0.05], 2))


def test_bootstrap_of_many_rows_is_as_wide_as_the_interval():
    """With errors alike in all rows both intervals are right; 50,000 rows are dealt into parts."""
    rng = np.random.default_rng(1)
    x = rng.uniform(1.0, 2.0, 50_000)
    (found,) = estimate(x[:, None], 3.0 * x + rng.normal(size=len(x)))
    assert found.boot_high - found.boot_low == pytest.approx(found.high - found.low, rel=0.1)
    assert found.low < 3.0 < found.high


def test_files_that_unpack_to_too_much_are_refused(tmp_path):
    with zipfile.ZipFile(tmp_path / "bomb.3mf", "w", zipfile.ZIP_DEFLATED) as archive:
        for k in range(10):
            archive.writestr(f"3D/{k}.model", bytes(10_000_000))
    assert (tmp_path / "bomb.3mf").stat().st_size < 200_000
    with pytest.raises(RftsimError, match="100 MB, which is more than the 64 that are read"):
        load_surface(tmp_path / "bomb.3mf")


@pytest.mark.parametrize("text", ["[]", "null", "{}", '{"key": "', '{"key": "x", "known": 3}', "[" * 100_000, "\0"])
def test_remembered_results_that_are_damaged_are_measured_again(tmp_path, text):
    path = tmp_path / "study.json"
    path.write_text(text)
    with pytest.warns(RftsimWarning, match=r"study\.json is damaged: all is measured again"):
        kept = Kept(path, b"inputs")
    assert kept.get("a", lambda: [1.0, 2.0]) == [1.0, 2.0]
    assert Kept(path, b"inputs").get("a", lambda: None) == [1.0, 2.0]
    path.write_text(path.read_text().replace("2.0", "3.0"))
    with pytest.warns(RftsimWarning, match="is damaged"):
        assert Kept(path, b"inputs").known == {}


def test_a_file_that_is_not_finished_is_not_beside_its_place(tmp_path):
    with replacing(tmp_path / "x.png") as temporary:
        temporary.write_bytes(b"half")
        assert list(tmp_path.iterdir()) == []
    assert (tmp_path / "x.png").read_bytes() == b"half"


@pytest.mark.parametrize(("number", "code", "said"), [(signal.SIGINT, 130, "stopped"), (signal.SIGTERM, 143, "")])
def test_signals_end_a_run_in_one_line(tmp_path, number, code, said):
    program = "import sys; from rftsim.cli import main; print('begun', flush=True); main(sys.argv[1:])"
    arguments = ("run", "grouser-wheel", "--duration", "1e5", "--plot", "x.png", "--record", "y.rrd")
    listening = {"preexec_fn": lambda: signal.signal(signal.SIGINT, signal.default_int_handler)}
    with subprocess.Popen(
        [sys.executable, "-P", "-c", program, *arguments],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        **listening,
    ) as process:
        assert process.stdout is not None
        process.stdout.readline()
        time.sleep(1.5)
        os.kill(process.pid, number)
        try:
            _, err = process.communicate(timeout=20)
        finally:
            process.kill()
    assert process.returncode == code
    assert err.split() == said.split()
    assert list(tmp_path.iterdir()) == []


CELLS = st.one_of(
    st.floats(allow_nan=True).map(repr),
    st.text(max_size=8),
    st.sampled_from(["1,5", "1.5", "", '"', "#", "1e400", "-"]),
)


@given(
    head=st.lists(st.sampled_from(["depth", "force", "Depth [m]", "force (N)", "area", "", "x"]), max_size=4),
    rows=st.lists(st.lists(CELLS, max_size=4), max_size=5),
    separator=st.sampled_from([",", ";", "\t"]),
    cut=st.integers(0, 200),
)
def test_any_table_is_read_or_refused(tmp_path_factory, head, rows, separator, cut):
    path = tmp_path_factory.mktemp("table") / "x.csv"
    lines = [separator.join(row) for row in [head, *rows]]
    path.write_bytes("\n".join(lines).encode("utf-8", "replace")[: cut if cut < 150 else None])
    try:
        found = read_columns(path, ("depth", "force"))
    except RftsimError as error:
        refusal = str(error)
    else:
        refusal = str(path)
        assert np.isfinite(found["depth"]).all()
        assert len(found["depth"]) == len(found["force"]) > 0
    assert str(path) in refusal


KEYS = ["rho_c", "mu_int", "mu_surf", "xi_n", "zeta", "g", "source", "preset", "y"]
VALUES = st.one_of(
    st.floats().map(repr),
    st.integers().map(str),
    st.sampled_from(["true", "[1.0]", "{a = 1}", '"1e6"', '"x"', "1979-05-27", "1e400", "'cubic'"]),
)


@given(table=st.dictionaries(st.sampled_from(KEYS), VALUES))
@settings(max_examples=150)
def test_any_sand_is_read_or_refused(tmp_path_factory, table):
    path = tmp_path_factory.mktemp("sand") / "x.toml"
    path.write_text("\n".join(f"{key} = {value}" for key, value in table.items()))
    try:
        sand = make_sand(str(path))
    except RftsimError:
        return
    except RftsimWarning:
        return
    assert isinstance(sand, Sand)
    assert np.isfinite([sand.xi_n, sand.zeta, sand.mu_surf]).all()
    assert sand.xi_n > 0.0


def exported(suffix):
    """The bytes of a box as a file."""
    content = trimesh.creation.box((0.1, 0.1, 0.1)).export(file_type=suffix)
    return content.encode() if isinstance(content, str) else content


WHOLE = {suffix: exported(suffix) for suffix in ("stl", "obj", "ply", "off", "3mf")}
"""Made once: 3MF numbers its parts at random."""


@given(suffix=st.sampled_from(sorted(WHOLE)), content=st.data())
def test_any_mesh_is_read_or_refused(tmp_path_factory, suffix, content):
    """Bytes of a closed mesh, changed or cut: what is read is finite, and what is not names the file."""
    path = tmp_path_factory.mktemp("mesh") / f"x.{suffix}"
    path.write_bytes(WHOLE[suffix])
    changed = bytearray(path.read_bytes())
    for _ in range(content.draw(st.integers(0, 4))):
        changed[content.draw(st.integers(0, len(changed) - 1))] = content.draw(st.integers(0, 255))
    path.write_bytes(changed[: content.draw(st.integers(0, len(changed)))] if content.draw(st.booleans()) else changed)
    try:
        surface = load_surface(path)
    except RftsimError as error:
        refusal = str(error)
    else:
        refusal = path.name
        assert np.isfinite(surface.triangles).all()
    assert path.name in refusal


WORDS = ["--velocity", "0", "-1", "nan", "1e400", "--scale", "--json", "--plane", "x", "--", "[", ""]


@given(words=st.lists(st.sampled_from(WORDS)))
@settings(max_examples=40)
def test_any_command_line_ends_in_one_line(tmp_path_factory, words):
    import contextlib
    import io

    from rftsim.cli import main

    path = tmp_path_factory.getbasetemp() / "command.stl"
    if not path.is_file():
        trimesh.creation.box((0.1, 0.1, 0.1)).export(path)
    said, code = io.StringIO(), 0
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
        try:
            main(["force", str(path), *words])
        except SystemExit as end:
            code = end.code
    assert code in (0, 2)
    assert len(said.getvalue().splitlines()) == (1 if code else 0)


@pytest.mark.slow
def test_commands_and_files_that_were_spoilt_end_well():
    """Three hundred of each, in processes of their own: see trials.py."""
    script = Path(__file__).parents[1] / "trials.py"
    done = subprocess.run([sys.executable, "-P", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-4000:]
    assert json.loads(done.stdout.splitlines()[-2].split()[0]) == 600
