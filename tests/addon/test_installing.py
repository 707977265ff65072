"""The operators and the drawing of the runtime's preferences, in Blender without a window."""

import os
import subprocess
import sys

import pytest
from addon.stub_runtime import write_wheels

bpy = pytest.importorskip("bpy")
pytestmark = pytest.mark.blender

from blender_addon.installing import operators, panels, preferences  # noqa: E402
from blender_addon.installing.installation import DONE, STOPPED, installation  # noqa: E402
from blender_addon.installing.plan import ENVIRONMENT  # noqa: E402
from blender_addon.installing.runtime_state import BROKEN, MISSING, READY, UNKNOWN  # noqa: E402
from blender_addon.worker.runtime_python import NO_RUNTIME, VARIABLE, Places, python_of  # noqa: E402


class Layout:
    """Stands in for Blender's layout, which needs a window: notes what is shown."""

    def __init__(self, shown=None):
        self.shown = [] if shown is None else shown

    def label(self, text, icon="NONE"):
        self.shown.append(text)

    def prop(self, _data, name, **_looks):
        self.shown.append(f"<{name}>")

    def operator(self, name, **_looks):
        self.shown.append(f"[{name}]")
        return self

    def progress(self, text, factor):
        self.shown.append(f"{text} ({factor:.1f})")

    def row(self, **_looks):
        return Layout(self.shown)

    column = box = row


@pytest.fixture
def place(addon, tmp_path, monkeypatch):
    """The add-on as an extension that brings a light runtime, in folders of its own; online."""
    wheel = write_wheels(tmp_path / "addon" / "runtime")
    monkeypatch.setattr(preferences, "FOLDER", tmp_path / "addon")
    monkeypatch.setattr(operators, "FOLDER", tmp_path / "addon")
    folder = tmp_path / "user files" / "runtime"
    for module in (preferences, operators):
        monkeypatch.setattr(module, "private_folder", lambda: folder)
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.setenv("PIP_FIND_LINKS", str(wheel.parent))
    monkeypatch.delenv(VARIABLE, raising=False)
    system = bpy.context.preferences.system
    before, system.use_online_access = system.use_online_access, True
    yield folder
    system.use_online_access = before


def shown_by(draw):
    layout = Layout()
    draw(layout)
    return "\n".join(layout.shown)


def test_setting_up_checking_and_removing_in_one_go(place, addon, capfd):
    assert bpy.ops.playable.set_up_runtime() == {"FINISHED"}
    assert installation.state.kind == READY and installation.said == DONE
    assert addon.places.private == place / ENVIRONMENT
    installation.forget()
    assert bpy.ops.playable.check_runtime() == {"FINISHED"}
    assert installation.state.python == str(python_of(place / ENVIRONMENT))
    assert "Ready: version" in shown_by(preferences.draw_state)
    assert bpy.ops.playable.remove_runtime() == {"FINISHED"}
    assert not (place / ENVIRONMENT).exists() and installation.state.kind == UNKNOWN
    with pytest.raises(RuntimeError, match="Nothing was set up that could be removed"):
        bpy.ops.playable.remove_runtime()


def test_offline_the_button_is_grey_and_says_how_to_allow_it(place):
    bpy.context.preferences.system.use_online_access = False
    with pytest.raises(RuntimeError, match="turn on Allow Online Access in Preferences > System"):
        bpy.ops.playable.set_up_runtime()
    assert not place.exists()
    shown = shown_by(preferences.draw_set_up)
    assert (
        "Allow Online Access" in shown.replace("\n", " ")
        and "[extensions.userpref_show_online]" in shown
    )


def test_a_checkout_says_that_it_brings_no_runtime(addon):
    with pytest.raises(RuntimeError, match="brings no runtime along"):
        bpy.ops.playable.set_up_runtime()


def test_a_set_up_that_fails_is_told_with_the_end_of_its_log(place, monkeypatch):
    monkeypatch.setenv("PIP_FIND_LINKS", "/nowhere")
    with pytest.raises(RuntimeError, match="installing the packages failed"):
        bpy.ops.playable.set_up_runtime()
    assert installation.failed and installation.state.kind == UNKNOWN
    shown = shown_by(preferences.draw_set_up)
    assert "installing the packages failed" in shown.replace("\n", " ")
    assert any("ERROR" in line for line in installation.log)
    assert [path.name for path in place.iterdir() if path.is_dir()] == []


def test_a_set_up_shows_its_progress_and_can_be_stopped_by_a_button(place, addon):
    operator = shown_by(preferences.draw_set_up)
    assert "[playable.set_up_runtime]" in operator and "[playable.cancel_set_up]" not in operator
    with pytest.raises(RuntimeError, match="Nothing is being set up"):
        bpy.ops.playable.cancel_set_up()
    plan = operators.SetUpPlan(sys.executable, next(preferences.FOLDER.rglob("p*.whl")), place)
    installation.begin_set_up(plan, addon.close, preferences.use_private_runtime)
    shown = shown_by(preferences.draw_set_up)
    assert "[playable.cancel_set_up]" in shown and "[playable.set_up_runtime]" not in shown
    for name in ("set_up_runtime", "remove_runtime"):
        with pytest.raises(RuntimeError, match="is being set up"):
            getattr(bpy.ops.playable, name)()
    assert bpy.ops.playable.cancel_set_up() == {"FINISHED"}
    assert installation.settle(wait=True) and installation.said == STOPPED
    assert [path.name for path in place.iterdir() if path.is_dir()] == []


def test_taking_the_addon_away_ends_what_is_under_way(place, addon):
    import blender_addon

    plan = operators.SetUpPlan(sys.executable, next(preferences.FOLDER.rglob("p*.whl")), place)
    installation.begin_set_up(plan, addon.close, preferences.use_private_runtime)
    blender_addon.unregister()
    assert not installation.busy
    assert [path.name for path in place.iterdir() if path.is_dir()] == []
    blender_addon.register()


def test_a_farm_names_its_python_without_preferences(addon, monkeypatch):
    monkeypatch.setenv(VARIABLE, "/farm/python")
    addon.use_command(None)
    addon.places = Places()
    bpy.ops.playable.check_runtime()
    assert (installation.state.kind, installation.state.python) == (BROKEN, "/farm/python")
    assert VARIABLE in shown_by(preferences.draw_state)
    tip = preferences.PlayableEnvironmentPreferences.__annotations__["runtime_python"]
    assert VARIABLE in tip.keywords["description"]


def test_without_a_runtime_every_request_tells_the_way(addon, monkeypatch, environment):
    monkeypatch.delenv(VARIABLE, raising=False)
    addon.use_command(None)
    addon.places = Places()
    with pytest.raises(RuntimeError) as caught:
        bpy.ops.playable.bake_paths()
    assert NO_RUNTIME in str(caught.value)
    bpy.ops.playable.check_runtime()
    assert installation.state.kind == MISSING


def test_without_a_runtime_the_sidebar_begins_with_the_way_to_one(place, addon):
    addon.use_command(None)
    addon.places = Places()
    assert panels.PLAYABLE_PT_set_up.poll(bpy.context)
    assert not panels.PLAYABLE_PT_runtime.poll(bpy.context)
    shown = shown_by(panels.draw_way_to_a_runtime)
    assert "[playable.set_up_runtime]" in shown and "[preferences.addon_show]" in shown


def test_with_a_runtime_the_sidebar_tells_what_the_worker_does(addon):
    assert not panels.PLAYABLE_PT_set_up.poll(bpy.context)
    assert panels.PLAYABLE_PT_runtime.poll(bpy.context)
    assert "Starts when it is needed" in shown_by(panels.draw_worker)
    addon.facts("fake")
    assert "Ready" in shown_by(panels.draw_worker)


def test_registering_starts_nothing_and_looks_at_no_file(addon):
    assert installation.state.kind == UNKNOWN and not installation.busy
    assert addon.worker_pid is None


WHOLE_STORY = """
import os, sys
import bpy, addon_utils
MODULE, wheels = "bl_ext.user_default.playable_environments", sys.argv[2]
bpy.ops.extensions.package_install_files(
    filepath=sys.argv[1], repo="user_default", enable_on_install=True)
assert addon_utils.check(MODULE) == (True, True)
bpy.context.preferences.system.use_online_access = True
user = bpy.utils.extension_path_user(MODULE, path="")
assert not os.path.exists(user), "enabling alone wrote into the user's folder"
assert bpy.ops.playable.set_up_runtime() == {"FINISHED"}
assert os.path.isfile(os.path.join(user, "runtime", "environment", "pyvenv.cfg")), user
module = sys.modules[MODULE + ".installing.installation"]
assert module.installation.state.kind == "ready", module.installation.state
preferences = bpy.context.preferences.addons[MODULE].preferences
assert preferences.runtime_python == ""
bpy.ops.preferences.addon_disable(module=MODULE)
bpy.ops.preferences.addon_enable(module=MODULE)
assert bpy.ops.playable.check_runtime() == {"FINISHED"}
assert bpy.ops.playable.remove_runtime() == {"FINISHED"}
assert not os.path.exists(os.path.join(user, "runtime", "environment"))
assert bpy.ops.playable.set_up_runtime() == {"FINISHED"}
repository = [r.module for r in bpy.context.preferences.extensions.repos].index("user_default")
bpy.ops.extensions.package_uninstall(repo_index=repository, pkg_id="playable_environments")
assert not hasattr(bpy.types.Scene, "playable_environment")
assert not [name for name in sys.modules if name.startswith(MODULE)]
assert not os.path.exists(user), os.listdir(user)
sys.stdout.flush()
os._exit(0)  # Blender 4.5 may wait for ever where it should end
"""


@pytest.mark.slow
def test_from_the_zip_alone_a_runtime_is_set_up_used_and_removed(tmp_path):
    from pe_runtime.packing.archives import zip_bytes
    from pe_runtime.packing.extension import extension_files

    wheel = write_wheels(tmp_path / "wheels")
    files = {name: data for name, data in extension_files().items() if "runtime/" not in name}
    files[f"runtime/{wheel.name}"] = wheel.read_bytes()
    (tmp_path / "extension.zip").write_bytes(zip_bytes(files))
    variables = os.environ | {
        "BLENDER_USER_RESOURCES": str(tmp_path / "blender"),
        "PIP_NO_INDEX": "1",
        "PIP_FIND_LINKS": str(wheel.parent),
    }
    variables.pop(VARIABLE, None)
    command = [sys.executable, "-c", WHOLE_STORY, str(tmp_path / "extension.zip"), str(wheel)]
    done = subprocess.run(command, cwd=tmp_path, env=variables, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
