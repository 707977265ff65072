#!/bin/sh
# Walks through the add-on in a real Blender window and leaves a picture of every step.
#
#   tests/gui/run.sh [FOLDER]     pictures, the extension and the film go there; default build/gui
#
# Variables: BLENDER  the program, default `blender` in PATH
#            PYTHON   a Python that has this project installed, default .venv/bin/python
#            SECONDS_AT_MOST  after which a stuck Blender is ended, default 900
# Needs Xvfb, whose screen nobody sees; ImageMagick's `import` takes the pictures where there is one.
# Ends with 0, or with 1 where a step has failed, or with 2 where something is missing.
set -u
cd "$(dirname "$0")/../.." || exit 2
out=${1:-build/gui}
blender=${BLENDER:-blender}
python=${PYTHON:-.venv/bin/python}

missing() { echo "gui: $1" >&2; exit 2; }
command -v "$blender" >/dev/null || missing \
  "there is no Blender: '$blender' is no program; name one: make gui BLENDER=/path/to/blender"
command -v Xvfb >/dev/null || missing \
  "there is no Xvfb to open a window on; on Debian or Ubuntu: sudo apt-get install xvfb"
[ -x "$python" ] || missing "there is no Python at '$python'; run: make install"

mkdir -p "$out"
out=$(cd "$out" && pwd)
# What an earlier walk has left, and nothing else.
rm -rf "$out/frames" "$out"/walkthrough.blend* "$out"/playable_environments-*.zip
home=$(mktemp -d) screen=
trap 'kill "$screen" 2>/dev/null; rm -rf "$home"' EXIT
trap 'exit 2' INT TERM
"$python" -m pe_runtime.cli extension build --out "$out" >/dev/null || exit 1

mkfifo "$home/display"
Xvfb -displayfd 3 -screen 0 1600x1000x24 -nolisten tcp 3>"$home/display" 2>/dev/null &
screen=$!
read -r number <"$home/display" || missing "Xvfb does not start"

# Settings of whoever calls this are neither read nor written.
export DISPLAY=":$number" BLENDER_USER_RESOURCES="$home" HOME="$home"
export GUI_PICTURES="$out" GUI_PYTHON="$(cd "$(dirname "$python")" && pwd)/$(basename "$python")"
timeout "${SECONDS_AT_MOST:-900}" "$blender" --factory-startup --gpu-backend opengl --enable-event-simulate \
  -p 0 0 1600 1000 --python-exit-code 1 --python tests/gui/walkthrough.py
code=$?
[ "$code" -eq 124 ] && echo "gui: Blender was stuck and has been ended" >&2
[ "$code" -eq 0 ] && echo "gui: the pictures are in $out" && exit 0
exit 1
