#!/bin/sh
# The sand on a GPU: its tests, the time of up to 8192 worlds, and of a task's episodes in them, without a network.
#
#   python3 -m pip download -d wheels -c constraints.txt '.[cli,envs,warp]' pytest hypothesis   # where there is a network
#   sh tests/peers/warp_on_gpu.sh wheels out                                     # on the GPU, from the project's root
set -eu
wheels=$1 out=$2
mkdir -p "$out"
python3 -m venv "$out/.venv"
"$out/.venv/bin/python" -m pip install --quiet --no-index --find-links "$wheels" -e '.[cli,envs,warp]' pytest hypothesis
export MUJOCO_GL=egl PYTHONPATH=models:envs:mpm
"$out/.venv/bin/rftsim" bench warp --json > "$out/warp.json"
"$out/.venv/bin/rftsim" bench warp
"$out/.venv/bin/python" tests/peers/task_on_gpu.py Quadruped 1024 4096
"$out/.venv/bin/python" -m pytest -q -p no:cacheprovider -o addopts= -o filterwarnings=default -m 'not slow' tests/warp
