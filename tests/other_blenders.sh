#!/bin/sh
# The add-on's tests in the other Blenders that it supports: 4.5 LTS beside the Python of .venv,
# 5.2 LTS in a Python 3.13 of its own where the machine has one. (`make test` runs them in 5.0.)
#
#   tests/other_blenders.sh [PYTEST ARGUMENTS]
#
# Variables: PYTHON     a Python 3.11 that has this project installed, default .venv/bin/python
#            PYTHON313  a Python 3.13, default python3.13 in PATH
#            PIP_FLAGS  for example an index with CPU builds of torch
set -eu
cd "$(dirname "$0")/.."
python=${PYTHON:-.venv/bin/python}
newer=${PYTHON313:-$(command -v python3.13 || true)}

older=build/bpy-4.5.15
if [ ! -d "$older" ]; then
  "$python" -m pip install --quiet --no-deps --target "$older.part" ${PIP_FLAGS:-} bpy==4.5.15
  mv "$older.part" "$older"
fi
echo "Blender 4.5.15, Python 3.11"
PYTHONPATH="$PWD/$older" "$python" -m pytest tests/addon -m "not slow" "$@"

if [ -z "$newer" ] || ! "$newer" -c 'import sys; sys.exit(sys.version_info[:2] != (3, 13))'; then
  echo "Blender 5.2.3 is left out: there is no Python 3.13 (name one: PYTHON313=/path/to/python3.13)"
  exit 0
fi
room=build/python3.13-bpy-5.2.3
if [ ! -f "$room/installed" ]; then
  "$newer" -m venv "$room"
  "$room/bin/python" -m pip install --quiet ${PIP_FLAGS:-} torch==2.13.0
  # Not by the project's own list: bpy 5.0 needs a NumPy before 2, bpy 5.2 one after it.
  "$room/bin/python" -m pip install --quiet ${PIP_FLAGS:-} bpy==5.2.3 \
    safetensors jaxtyping OpenImageIO opencv-contrib-python-headless trimesh scikit-image scipy \
    rich typer matplotlib pytest hypothesis beartype psutil
  "$room/bin/python" -m pip install --quiet --no-deps -e .
  touch "$room/installed"
fi
echo "Blender 5.2.3, Python 3.13"
"$room/bin/python" -m pytest tests/addon -m "not slow" "$@"
