"""Registering adds what it should; unregistering leaves nothing behind."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

bpy = pytest.importorskip("bpy")
pytestmark = pytest.mark.blender

ROOT = Path(__file__).parents[2]
BEGIN = """
import os, sys
import bpy
from addon import stage
from addon.blender_snapshot import LIVE, classes, everything, watch
watch()
bpy.ops.wm.read_factory_settings(use_empty=True)
import blender_addon
def compare(now, then, when):
    assert now == then, (when, sorted(map(str, now - then)), sorted(map(str, then - now)))
before = everything()
"""
TWICE = """
blender_addon.register()
during = everything()
names = {entry[1:] for entry in during - before if entry[0] == "attribute"}
assert ("Scene", "playable_environment") in names and ("Object", "playable") in names
assert ("engine", "RENDER_PT_format", "PLAYABLE_ENV") in during - before
assert [entry for entry in during - before if entry[:2] == ("operator", "playable")]
assert classes("blender_addon")
assert not [e for e in during - before if e[0] in ("thread", "child", "timer")], "not at register"
for time in range(3):
    blender_addon.unregister()
    compare(everything(), before, f"unregistered {time}")
    assert classes("blender_addon") == []
    blender_addon.register()
    compare(everything(), during, f"registered again {time}")
blender_addon.unregister()
compare(everything(), before, "at the end")
"""
BUSY = """
from blender_addon.worker.session import session
blender_addon.register()
session.use_command(stage.FAKE)
session.facts("fake")
assert session.worker_pid
assert [entry for entry in everything() if entry[0] == "child"]
from blender_addon.installing.installation import installation
installation.begin_check(session.places)
blender_addon.unregister()
compare(everything(), before, "with a worker and a check under way")
"""
FILES = """
blender_addon.register()
during = everything()
path = os.path.join(sys.argv[1], "file.blend")
bpy.ops.wm.save_as_mainfile(filepath=path)
for _ in range(2):
    bpy.ops.wm.open_mainfile(filepath=path)
    compare(everything(), during, "after opening a file")
bpy.ops.wm.read_homefile(use_empty=True)
compare(everything(), during, "after a new file")
blender_addon.unregister()
bpy.ops.wm.open_mainfile(filepath=path)
compare(everything(), before, "unregistered, and a file opened")
"""
ENABLED = """
import addon_utils
folder = os.path.join(sys.argv[1], "dev")
os.makedirs(folder)
os.symlink(os.path.dirname(blender_addon.__file__), os.path.join(folder, "playable_environments"))
repositories = bpy.context.preferences.extensions.repos
repositories.new(name="dev", module="dev", custom_directory=folder)
MODULE = "bl_ext.dev.playable_environments"
before = everything()
for time in range(3):
    bpy.ops.preferences.addon_enable(module=MODULE)
    assert addon_utils.check(MODULE)[1], "not enabled"
    assert hasattr(bpy.types.Scene, "playable_environment")
    assert bpy.context.preferences.addons[MODULE].preferences.bl_rna
    assert not os.path.exists(bpy.utils.extension_path_user(MODULE, path=""))
    bpy.ops.preferences.addon_disable(module=MODULE)
    compare(everything(), before, f"disabled {time}")
"""


# Blender 4.5 waits for ever at the end of a program that leaves an operator of anybody registered.
END = """
sys.stdout.flush()
os._exit(0)
"""


def run(program, *arguments, **variables):
    """In an interpreter of its own, so that no other test has registered anything before."""
    reached = (str(ROOT), str(ROOT / "tests"), os.environ.get("PYTHONPATH", ""))
    known = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, reached))}
    command = [sys.executable, "-c", BEGIN + program + END, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, env=known | variables)
    assert done.returncode == 0, done.stderr


def test_registering_again_and_again_adds_the_same_and_leaves_nothing():
    run(TWICE)


def test_unregistering_ends_the_worker_and_whatever_is_under_way():
    run(BUSY)


def test_opening_files_adds_nothing_and_loses_nothing(tmp_path):
    run(FILES, tmp_path)


def test_enabling_and_disabling_in_the_preferences_leaves_nothing(tmp_path):
    run(ENABLED, tmp_path, BLENDER_USER_RESOURCES=str(tmp_path / "blender"))


def test_importing_the_addon_loads_neither_blender_nor_the_runtime():
    program = (
        "import sys, blender_addon; "
        "sys.exit(any(n in sys.modules for n in ('bpy', 'numpy', 'torch', 'pe_runtime')))"
    )
    assert subprocess.run([sys.executable, "-c", program]).returncode == 0


@pytest.mark.parametrize(
    "what",
    [
        "bpy.types.Scene.left = bpy.props.IntProperty()",
        "class LEFT_MT_x(bpy.types.Menu):\n bl_label = 'x'\n def draw(self, context): pass\n"
        "bpy.utils.register_class(LEFT_MT_x)",
        "bpy.app.handlers.load_post.append(print)",
        "bpy.app.timers.register(print)",
        "bpy.types.SpaceView3D.draw_handler_add(print, (), 'WINDOW', 'POST_VIEW')",
        "bpy.types.RENDER_PT_format.COMPAT_ENGINES.add('LEFT')",
        "bpy.types.VIEW3D_MT_object.append(lambda self, context: None)",
        "bpy.context.window_manager.keyconfigs.addon.keymaps.new('Left').keymap_items.new("
        "'wm.save_mainfile', 'A', 'PRESS')",
        "import threading as t; t.Thread(target=t.Event().wait, daemon=True, name='left').start()",
        "import atexit; atexit.register(print)",
        "import subprocess; child = subprocess.Popen([sys.executable, '-c', 'input()'], "
        "stdin=subprocess.PIPE)",
    ],
)
@pytest.mark.slow
def test_the_snapshot_sees_what_is_left_behind(what):
    run(f"{what}\nassert everything() != before")


def test_the_manifest_is_accepted_by_blenders_own_check(tmp_path):
    import tomllib

    import blender_addon

    source = Path(blender_addon.__file__).parent
    text = (source / "blender_manifest.toml").read_text()
    assert tomllib.loads(text)["version"] == __import__("pe_runtime").__version__
    checker = next(Path(bpy.__file__).parents[2].rglob("bl_pkg/cli/blender_ext.py"))
    (tmp_path / "blender_manifest.toml").write_text(text)
    (tmp_path / "__init__.py").write_text("")
    done = subprocess.run(
        [sys.executable, str(checker), "validate", str(tmp_path)], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr
