"""Whatever ends a render, at any moment: Blender lives, no partial file, the next one works."""

import os
import random
import shutil
import signal
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from addon.stage import FAKE, faulty, read_png

bpy = pytest.importorskip("bpy")
from blender_addon.filming import engine, frame_watch, written_files  # noqa: E402 - after the check for Blender
from blender_addon.filming.engine import PlayableEnvironmentEngine  # noqa: E402
from blender_addon.filming.written_files import cut_off  # noqa: E402
from blender_addon.worker.replies import WorkerCancelledError  # noqa: E402

pytestmark = pytest.mark.blender
COUNT, MOMENTS = 12, 20
DEADLINE = 60.0


@pytest.fixture
def baked(environment):
    environment.frame_end = COUNT
    environment.render.image_settings.color_mode = "RGB"
    bpy.ops.playable.bake_paths()
    return environment


@pytest.fixture
def expected(baked, tmp_path):
    """The pictures of a render that nobody disturbs."""
    return animate(baked, tmp_path / "expected")


def animate(scene, folder):
    scene.render.filepath = str(folder / "f_####")
    bpy.ops.render.render(animation=True, scene=scene.name)
    return pictures(folder)


def pictures(folder):
    return {path.name: read_png(path) for path in sorted(folder.glob("*"))}


def all_whole(found, expected):
    """Whether the pictures are the first of the expected ones, each of them whole."""
    assert list(found) == list(expected)[: len(found)]
    return all(np.array_equal(each, expected[name]) for name, each in found.items())


def test_a_worker_killed_at_any_moment_leaves_whole_pictures_and_the_next_render_works(
    baked, addon, expected, tmp_path
):
    chance, failed = random.Random(1), 0
    for number in range(MOMENTS):
        folder = tmp_path / str(number)
        killer = threading.Timer(chance.uniform(0.0, 0.12), _kill, args=(_worker_of(addon),))
        killer.start()
        try:
            animate(baked, folder)
        except RuntimeError as error:
            failed += 1
            assert "the worker ended" in str(error) and len(str(error).splitlines()) == 1
        killer.join()
        assert all_whole(pictures(folder), expected)
    assert failed > 0
    assert all_whole(animate(baked, tmp_path / "next"), expected)


def _worker_of(addon):
    addon.facts("fake")
    while (pid := addon.worker_pid) is None:  # the last one has only just been killed
        addon.facts("fake")
    return pid


def _kill(pid):
    with suppress(ProcessLookupError):  # the last one's end may have taken it along
        os.kill(pid, signal.SIGKILL)


def test_ctrl_c_at_any_moment_leaves_whole_pictures_and_the_next_render_works(
    baked, addon, expected, tmp_path
):
    chance = random.Random(2)
    for number in range(MOMENTS):
        folder, left = tmp_path / str(number), [chance.randrange(0, 2 * COUNT)]
        addon.use_command(FAKE)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(engine.FrameWatch, "__call__", _interrupt_after(left))
            patch.setattr(engine.FrameWatch, "finish", _interrupt_after(left))
            with pytest.raises(RuntimeError, match="KeyboardInterrupt") as caught:
                animate(baked, folder)
        assert len(str(caught.value).splitlines()) == 1
        assert all_whole(pictures(folder), expected)
    assert all_whole(animate(baked, tmp_path / "next"), expected)


def _interrupt_after(left):
    def asked(*_):
        left[0] -= 1
        if left[0] < 0:
            signal.raise_signal(signal.SIGINT)
        return False

    return asked


class EscBar:
    """Blender's progress bar in a window whose Esc is pressed when a function says so."""

    def __init__(self, bar, pressed):
        self.update_progress, self.update_stats = bar.update_progress, bar.update_stats
        self.test_break = pressed


def watching(pressed):
    return lambda bar, *rest: frame_watch.FrameWatch(EscBar(bar, pressed), *rest)


@pytest.mark.parametrize(
    ("mode", "stage"),
    [
        ("silent", "Starting the runtime"),
        ("slow_to_load", "Loading the model"),
        ("slow_to_prepare", "Predicting the paths"),
        ("slow", ""),
    ],
)
def test_esc_is_heard_in_every_stage_before_the_worker_has_an_answer(
    baked, addon, monkeypatch, mode, stage
):
    addon.use_command(faulty(mode))
    if mode in ("slow", "slow_to_prepare"):
        addon.facts("fake")
    seen, handed_over, said = [], [], []

    def pressed():
        seen.append(addon.doing)
        return addon.doing == stage and (stage != "" or addon.status == "busy")

    monkeypatch.setattr(engine, "FrameWatch", watching(pressed))
    monkeypatch.setattr(PlayableEnvironmentEngine, "_hand_over", lambda *_: handed_over.append(1))
    monkeypatch.setattr(PlayableEnvironmentEngine, "_fail", lambda *given: said.append(given[1:]))
    bpy.ops.render.render(scene=baked.name)
    # Blender asks no more of an engine that was stopped than to come back without a word.
    assert seen[-1] == stage and not handed_over
    monkeypatch.undo()
    addon.use_command(FAKE)
    bpy.ops.render.render(scene=baked.name)
    assert addon.status == "ready"


def test_esc_is_heard_while_a_picture_is_encoded(scene, addon):
    from blender_addon.worker.background import BackgroundCall
    from pe_runtime.contract.camera import Camera

    addon.use_command(faulty("slow_to_encode"))
    addon.facts("fake")
    camera = Camera(8, 4, np.array([[8.0, 0, 4], [0, 8, 2], [0, 0, 1]]), np.eye(4))
    begun = threading.Event()

    def encode(should_stop, _):
        def stop():
            begun.set()
            return should_stop()

        return addon.encode("fake", np.zeros((4, 8, 3), np.uint8), camera, {}, stop)

    call = BackgroundCall(encode)
    assert begun.wait(DEADLINE)
    call.cancel()
    with pytest.raises(WorkerCancelledError):
        call.result()
    assert addon._client._inbox.empty()
    assert addon.facts("fake").name == "fake"


def test_esc_is_heard_while_another_request_has_the_worker(baked, addon, monkeypatch):
    from addon.test_turns import drawing_slowly

    addon.use_command(faulty("slow"))
    addon.facts("fake")
    picture = Path(baked.playable_environment.image_path)
    other = drawing_slowly(addon, picture, 1)
    monkeypatch.setattr(engine, "FrameWatch", watching(lambda: True))
    with pytest.raises(RuntimeError, match="it was cancelled"):
        bpy.ops.render.render(scene=baked.name)
    assert not other.done
    assert other.result().number == 1


def test_a_folder_that_becomes_unwritable_stops_the_range_at_once(baked, addon, expected, tmp_path):
    chance, handlers = random.Random(3), bpy.app.handlers.render_pre
    for number in range(MOMENTS):
        folder, moment = tmp_path / str(number), chance.randrange(1, COUNT + 1)

        def take_away(scene, *_, folder=folder, moment=moment):
            if scene.frame_current == moment:
                if folder.exists():
                    folder.rename(folder.with_suffix(".kept"))
                folder.write_text("no folder")

        handlers.append(take_away)
        with pytest.raises(RuntimeError, match="cannot save"):
            animate(baked, folder)
        handlers.remove(take_away)
        kept = folder.with_suffix(".kept")
        found = pictures(kept) if kept.exists() else {}
        assert len(found) == moment - 1 and all_whole(found, expected)
    assert all_whole(animate(baked, tmp_path / "next"), expected)


FULL_DISK = """
import os, random, resource, signal, sys
import bpy
from addon import stage
import blender_addon
from blender_addon.worker.session import session
film, folder = sys.argv[1:]
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
blender_addon.register()
bpy.ops.wm.open_mainfile(filepath=film)
session.use_command(stage.FAKE)
session.facts("fake")
scene = bpy.context.scene
unlimited = resource.getrlimit(resource.RLIMIT_FSIZE)
chance, moment, bytes_left = random.Random(4), 0, 0
def fill(scene, *_):
    if scene.frame_current == moment:
        resource.setrlimit(resource.RLIMIT_FSIZE, (bytes_left, unlimited[1]))
bpy.app.handlers.render_pre.append(fill)
for number in range(20):
    moment, bytes_left = chance.randrange(1, scene.frame_end + 1), chance.choice([0, 10, 100, 300])
    scene.render.filepath = os.path.join(folder, str(number), "f_####")
    try:
        bpy.ops.render.render(animation=True)
        text = "FINISHED"
    except RuntimeError as error:
        text = str(error).strip()
    resource.setrlimit(resource.RLIMIT_FSIZE, unlimited)
    sys.stderr.write(f"outcome {moment} {text}\\n")
moment = 0
scene.render.filepath = os.path.join(folder, "next", "f_####")
bpy.ops.render.render(animation=True)
session.close()
sys.stderr.flush()
os._exit(0)
"""


def test_a_disk_that_becomes_full_stops_the_range_and_leaves_no_partial_picture(
    baked, expected, tmp_path
):
    film, folder = tmp_path / "film.blend", tmp_path / "full"
    bpy.ops.wm.save_as_mainfile(filepath=str(film), copy=True)
    done = run(FULL_DISK, film, folder)
    assert done.returncode == 0, done.stderr[-2000:]
    lines = [line for line in done.stderr.splitlines() if line.startswith("outcome")]
    assert len(lines) == MOMENTS
    for number, line in enumerate(lines):
        moment, text = line.split(maxsplit=2)[1:]
        found = pictures(folder / str(number))
        assert len(found) == int(moment) - 1 and all_whole(found, expected)
        # After the last frame Blender asks nobody any more; the file is gone and the log says why.
        last = int(moment) == COUNT and text == "FINISHED"
        assert last or "the disk may be full" in text or "cannot save" in text, line
    assert done.stderr.count("was not written whole") >= len(lines)
    assert all_whole(pictures(folder / "next"), expected)


def run(program, *arguments):
    """In another process, so that a Blender that dies is seen."""
    tests = Path(__file__).parents[1]
    paths = [str(tests), str(tests.parent), os.environ.get("PYTHONPATH", "")]
    return subprocess.run(
        [sys.executable, "-c", program, *map(str, arguments)],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, paths))},
        capture_output=True,
        text=True,
        timeout=3 * DEADLINE,
    )


def test_a_disk_without_room_for_a_frame_is_said_before_it_is_drawn(
    baked, addon, tmp_path, monkeypatch
):
    usage = shutil.disk_usage(tmp_path)._replace(free=1 << 19)
    monkeypatch.setattr(written_files.shutil, "disk_usage", lambda _: usage)
    monkeypatch.setattr(addon, "render", lambda *_: pytest.fail("it was drawn"))
    with pytest.raises(RuntimeError, match="has 0 MB left and a frame may take 1 MB"):
        animate(baked, tmp_path / "frames")
    monkeypatch.undo()
    bpy.ops.render.render(scene=baked.name)


def test_a_cut_picture_is_told_from_a_whole_one(expected, tmp_path):
    whole = next((tmp_path / "expected").glob("*.png"))
    content = whole.read_bytes()
    assert not cut_off(whole)
    for size in (0, 5, len(content) - 1):
        cut = tmp_path / "cut.png"
        cut.write_bytes(content[:size])
        assert cut_off(cut)
    assert not cut_off(tmp_path / "none.png")
    (tmp_path / "other.exr").write_bytes(b"anything")
    assert not cut_off(tmp_path / "other.exr")


MISSING_MODEL = """
import os, sys
import bpy
import blender_addon
from addon import stage
from blender_addon.worker.session import session
film, folder = sys.argv[1:]
blender_addon.register()
bpy.ops.wm.open_mainfile(filepath=film)
session.use_command(stage.FAKE)
bpy.context.scene.render.filepath = os.path.join(folder, "f_####")
try:
    bpy.ops.render.render(animation=True)
    code = 0
except RuntimeError as error:
    sys.stderr.write(str(error))
    code = 1
session.close()
sys.stdout.flush()
sys.stderr.flush()
os._exit(code)
"""


def test_a_missing_model_is_one_clear_line_and_no_picture(scene, picture, addon, tmp_path):
    import json

    from addon.stage import BOXES

    film, folder = tmp_path / "film.blend", tmp_path / "frames"
    bpy.ops.playable.new_environment(image=str(picture), model="fake", boxes=json.dumps(BOXES))
    bpy.ops.playable.bake_paths()
    text = scene.playable_environment.bake_text
    stored = json.loads(text.as_string())
    from pe_runtime.contract.shot import Shot

    stored["shot"]["model"] = "/somewhere/gone.safetensors"
    stored["digest"] = Shot.from_dict(stored["shot"]).digest()
    text.clear()
    text.write(json.dumps(stored))
    bpy.ops.wm.save_as_mainfile(filepath=str(film), copy=True)
    done = run(MISSING_MODEL, film, folder)
    assert done.returncode == 1
    lines = [line for line in done.stderr.splitlines() if line.strip()]
    assert len(lines) == 1, done.stderr
    assert "frame 1" in lines[0] and "no model '/somewhere/gone.safetensors'" in lines[0]
    assert "Traceback" not in done.stdout
    assert not folder.exists() or list(folder.iterdir()) == []
