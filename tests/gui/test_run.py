"""What the walkthrough's script says where it cannot begin."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).with_name("run.sh")
pytestmark = pytest.mark.skipif(shutil.which("sh") is None, reason="a script of a Unix shell")


def run(folder, path, **variables):
    """The script in a world whose programs are those of `path`."""
    environment = {**os.environ, "PATH": str(path), "PYTHON": sys.executable, **variables}
    command = [shutil.which("sh"), str(SCRIPT), str(folder)]
    return subprocess.run(command, env=environment, capture_output=True, text=True)


@pytest.fixture
def programs(tmp_path):
    """A folder with the few programs that the script begins with."""
    made = tmp_path / "programs"
    made.mkdir()
    for name in ("dirname", "basename"):
        (made / name).symlink_to(shutil.which(name))
    return made


def add_program(folder, name):
    (folder / name).write_text("#!/bin/sh\nexit 0\n")
    (folder / name).chmod(0o755)


def test_without_blender_it_says_how_to_name_one(tmp_path, programs):
    done = run(tmp_path / "out", programs, BLENDER="no-such-blender")
    assert done.returncode == 2 and "no-such-blender" in done.stderr
    assert "make gui BLENDER=" in done.stderr and not (tmp_path / "out").exists()


def test_without_a_screen_it_says_what_to_install(tmp_path, programs):
    add_program(programs, "blender")
    done = run(tmp_path / "out", programs)
    assert done.returncode == 2 and "apt-get install xvfb" in done.stderr


def test_without_an_installed_python_it_says_what_installs_it(tmp_path, programs):
    for name in ("blender", "Xvfb"):
        add_program(programs, name)
    done = run(tmp_path / "out", programs, PYTHON=str(tmp_path / "none"))
    assert done.returncode == 2 and "make install" in done.stderr
