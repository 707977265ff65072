# From a bare machine:  make demo   a picture becomes a filmed strip, in build/demo
#                       make test   formatting, lint and the tests that take seconds
#                       make gui    the walkthrough in a real Blender window, its pictures in
#                                   build/gui (needs Blender and Xvfb: BLENDER=/path/to/blender)
#                       make test-blenders   the add-on's tests in Blender 4.5 and 5.2
#                       make example   a cube that passes between two players, in
#                                      build/passing_cube
# Needs Python 3.11 (Blender 5.0's) and a network on the first run; later runs start at once.
# On Linux without a CUDA card, a CPU build of torch saves gigabytes; name an index that has one:
#   make demo PIP_FLAGS="--extra-index-url https://download.pytorch.org/whl/cpu"

PYTHON ?= $(shell command -v python3.11 || command -v python3 || echo python3)
PIP_FLAGS ?=
BLENDER ?= blender
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip install --disable-pip-version-check --quiet $(PIP_FLAGS)
STAMP := $(VENV)/.installed
BLENDER_LIBRARIES := libx11-6 libxrender1 libxfixes3 libxi6 libxext6 libxkbcommon0 libsm6 \
	libgl1 libegl1 libgl1-mesa-dri
# EGL is opened late, when the first frame is drawn: ask for it by name.
BLENDER_STARTS := $(BIN)/python -c 'import bpy, ctypes, sys; \
	sys.platform == "linux" and ctypes.CDLL("libEGL.so.1")'
# As root (a container, CI) missing libraries are installed; anyone else is told the line.
BRING_LIBRARIES := if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
	  apt-get update -qq && DEBIAN_FRONTEND=noninteractive \
	    apt-get install -y -qq --no-upgrade --no-install-recommends $(BLENDER_LIBRARIES); \
	else \
	  echo "Blender lacks system libraries. On Debian or Ubuntu:" \
	    "sudo apt-get install $(BLENDER_LIBRARIES)" >&2; exit 1; \
	fi

.DEFAULT_GOAL := help
.PHONY: help demo example test test-slow test-blenders gui format install clean

help:
	@sed -n '1,10p' Makefile | sed 's/^# //'

demo: install
	$(BIN)/pe demo --out build/demo

example: install
	$(BIN)/pe demo --passing-cube --out build/passing_cube

test: install
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/python -m pytest -m "not slow"

test-slow: install
	$(BIN)/python -m pytest -m slow

test-blenders: install
	PYTHON='$(BIN)/python' PIP_FLAGS='$(PIP_FLAGS)' tests/other_blenders.sh

gui: install
	BLENDER='$(BLENDER)' PYTHON='$(BIN)/python' tests/gui/run.sh build/gui

format: install
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

install: $(STAMP)

$(STAMP): pyproject.toml constraints.txt Makefile
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))' || { \
	  echo "Python 3.11 is needed (bpy 5.0 has wheels for no other); '$(PYTHON)' is" \
	    "$$($(PYTHON) --version 2>&1). Install it, then: make PYTHON=/path/to/python3.11" >&2; \
	  exit 1; }
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV) || { \
	  rm -rf $(VENV); echo "Cannot make $(VENV); on Debian: apt-get install python3-venv" >&2; \
	  exit 1; }
	@echo "Installing into $(VENV) (torch and Blender: about a gigabyte, a few minutes)"
	$(PIP) torch==2.13.0
	$(PIP) -c constraints.txt -e '.[blender,dev]'
	@$(BLENDER_STARTS) 2>/dev/null || { $(BRING_LIBRARIES); $(BLENDER_STARTS); }
	@touch $@

clean:
	rm -rf $(VENV) build
