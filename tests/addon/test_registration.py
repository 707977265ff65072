"""Registering adds what it should; unregistering leaves nothing behind."""

import subprocess
import sys

import pytest

bpy = pytest.importorskip("bpy")
pytestmark = pytest.mark.blender

# In an interpreter of its own, so that no other test has registered anything before.
SNAPSHOT = """
import bpy, blender_addon
KINDS = [getattr(bpy.types, name) for name in dir(bpy.types)]
KINDS = [kind for kind in KINDS if isinstance(kind, type) and issubclass(kind, bpy.types.ID)]
assert bpy.types.Scene in KINDS and bpy.types.WindowManager in KINDS
def everything():
    names = {(kind.__name__, name) for kind in KINDS for name in dir(kind)} | set(dir(bpy.types))
    handlers = {(h, len(getattr(bpy.app.handlers, h))) for h in dir(bpy.app.handlers)
                if isinstance(getattr(bpy.app.handlers, h), list)}
    engines = {(p.__name__, e) for p in bpy.types.Panel.__subclasses__()
               for e in getattr(p, "COMPAT_ENGINES", ())}
    operators = {o for o in dir(bpy.ops) if dir(getattr(bpy.ops, o))}
    return names | handlers | engines | operators
before = everything()
blender_addon.register()
during = everything()
blender_addon.unregister()
after = everything()
assert ("Scene", "playable_environment") in during - before
assert ("RENDER_PT_format", "PLAYABLE_ENV") in during - before
assert "playable" in during - before
assert after == before, (after - before, before - after)
blender_addon.register()
assert everything() == during
blender_addon.unregister()
"""


def test_unregistering_leaves_nothing_and_registering_again_works():
    done = subprocess.run([sys.executable, "-c", SNAPSHOT], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_importing_the_addon_loads_neither_blender_nor_the_runtime():
    program = (
        "import sys, blender_addon; "
        "sys.exit(any(n in sys.modules for n in ('bpy', 'numpy', 'torch', 'pe_runtime')))"
    )
    assert subprocess.run([sys.executable, "-c", program]).returncode == 0


def test_the_manifest_is_accepted_by_blenders_own_check(tmp_path):
    import tomllib
    from pathlib import Path

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
