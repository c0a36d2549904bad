# Everything runs in .venv, which `make` sets up on a machine that has python3 >= 3.11 and make.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile
# The lowest and the newest MuJoCo that the core is tested on; .venv has the one that dm_control needs.
MUJOCO_LOWEST := 3.5.0
MUJOCO_NEWEST := 4.0.0
export MUJOCO_GL ?= egl

.PHONY: demo test check unit readme native docs tables pictures notebooks wheel test-slow test-mujoco test-mjlab clean

demo: $(VENV)/run
	$(BIN)/rftsim demo

test: check unit readme

check: $(VENV)/ready
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

unit: $(VENV)/ready
	$(BIN)/pytest

readme: $(VENV)/ready
	$(BIN)/python tests/readme.py

# The machine code that ships, after an edit of what is compiled.
native: $(VENV)/ready
	$(BIN)/python -P rftsim/machine/build.py

# The pages, into out/docs; the tables that commands print for them, their pictures and notebooks.
docs: $(VENV)/ready
	$(BIN)/sphinx-build -q -W --keep-going -b html docs out/docs

tables: $(VENV)/ready
	$(BIN)/python docs/tables.py

pictures: $(VENV)/ready
	$(BIN)/python docs/gallery.py

notebooks: $(VENV)/ready
	$(BIN)/python docs/notebooks.py

wheel: $(VENV)/ready
	$(BIN)/hatchling build -d dist

test-slow: $(VENV)/ready
	$(BIN)/pytest -m slow

# The core's own tests on other versions of MuJoCo, each in an environment of its own.
test-mujoco: test-mujoco-$(MUJOCO_LOWEST) test-mujoco-$(MUJOCO_NEWEST)

test-mujoco-%: .venv-mujoco-%/ready
	.venv-mujoco-$*/bin/pytest tests/verification tests/engine

# The example for mjlab, in an environment of its own, as mjlab wants a MuJoCo of its own; warnings there are others'.
test-mjlab: .venv-mjlab/ready
	CUDA_VISIBLE_DEVICES= .venv-mjlab/bin/pytest -W default tests/in_mjlab

# What running needs, and then what checking needs.
$(VENV)/run: pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "rftsim needs python3 >= 3.11; set PYTHON")'
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(PIP) -c constraints.txt -e '.[cli,rerun]'
	touch $@

$(VENV)/ready: $(VENV)/run
	$(PIP) -c constraints.txt -e '.[dev]'
	touch $@

.PRECIOUS: .venv-mujoco-%/ready
.venv-mujoco-%/ready: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv-mujoco-$*
	grep -v '^mujoco==' constraints.txt > .venv-mujoco-$*/constraints.txt
	.venv-mujoco-$*/bin/python -m pip install --quiet --disable-pip-version-check -c .venv-mujoco-$*/constraints.txt \
		numpy numba trimesh scipy networkx pytest pytest-benchmark hypothesis rich tyro matplotlib
	.venv-mujoco-$*/bin/python -m pip install --quiet --disable-pip-version-check mujoco==$*
	.venv-mujoco-$*/bin/python -m pip install --quiet --disable-pip-version-check --no-deps -e .
	touch $@

.venv-mjlab/ready: pyproject.toml constraints-mjlab.txt
	test -x .venv-mjlab/bin/python || $(PYTHON) -m venv .venv-mjlab
	.venv-mjlab/bin/python -m pip install --quiet --disable-pip-version-check --no-compile -c constraints-mjlab.txt \
		mjlab pytest pytest-benchmark hypothesis -e '.[warp]'
	touch $@

clean:
	rm -rf .venv .venv-mujoco-* .venv-mjlab out
