"""Real key presses in a pseudo-terminal, and the terminal as it was afterwards."""

import io
import json
import os
import select
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import small_world
import tiny_model
from rich.console import Console

from pe_runtime.cli.keyboard import Keys, Lines, has_single_keys, single_keys
from pe_runtime.cli.live import LiveLoop
from pe_runtime.cli.preview import Preview, can_preview
from pe_runtime.cli.screen import LineScreen
from pe_runtime.contract.shot import Start
from pe_runtime.play import (
    LivePlay,
    Wishes,
    finished_frames,
    learnt_actions,
    set_stage,
    shot_of_session,
)
from pe_runtime.state import EnvironmentState, ObjectState, state_as_dict

fcntl = pytest.importorskip("fcntl", reason="needs a Unix terminal")
pty = pytest.importorskip("pty", reason="needs a Unix terminal")
termios = pytest.importorskip("termios", reason="needs a Unix terminal")
ROOT = Path(__file__).parents[1]
PATIENCE = 60.0
"""Seconds; only a failure waits that long."""


@pytest.fixture
def terminal():
    """Both ends of a pseudo-terminal: the keyboard's descriptor and the program's stream."""
    keyboard, program = pty.openpty()
    with os.fdopen(program, "r") as stream:
        yield keyboard, stream
    os.close(keyboard)


def modes(stream):
    return termios.tcgetattr(stream.fileno())


def press(keyboard, sent):
    os.write(keyboard, sent)


def test_keys_come_one_by_one_without_enter_and_with_their_names(terminal):
    keyboard, stream = terminal
    with single_keys(stream) as keys:
        press(keyboard, b"1\t \x1b[A\x1bOD\x7f\nq\x04")
        assert list(keys) == ["1", "tab", "space", "↑", "←", "backspace", "q"]


def test_keys_nobody_knows_are_swallowed_whole(terminal):
    keyboard, stream = terminal
    with single_keys(stream) as keys:
        press(keyboard, b"\x1b[5~\x1b[1;5C\x1bx\xc3\xa92\x04")
        assert [key for key in keys if key.isascii()] == ["2"]


def test_a_key_that_waits_is_known_before_it_is_read(terminal):
    keyboard, stream = terminal
    with single_keys(stream) as keys:
        assert not keys.waiting()
        press(keyboard, b"a")
        assert select.select([stream.fileno()], [], [], PATIENCE)[0]
        assert keys.waiting()


def test_the_terminal_echoes_again_after_the_block_whatever_ended_it(terminal):
    _, stream = terminal
    before = modes(stream)
    with single_keys(stream):
        assert not modes(stream)[3] & (termios.ECHO | termios.ICANON)
    assert modes(stream) == before
    for error in (ValueError, KeyboardInterrupt, SystemExit):
        with pytest.raises(error), single_keys(stream):
            raise error
        assert modes(stream) == before


def test_keys_need_a_terminal_and_lines_do_not(terminal, tmp_path):
    assert has_single_keys(terminal[1])
    (tmp_path / "lines").write_text("1 2\n\n q\n")
    with (tmp_path / "lines").open() as stream:
        assert not has_single_keys(stream)
        lines = Lines(stream)
        assert list(lines) == ["1", "2", "q"]
        assert not lines.waiting()
    assert not isinstance(lines, Keys)


def test_a_preview_has_two_pixels_a_character_and_fits():
    picture = np.zeros((36, 64, 3), np.float32)
    picture[:18] = (1.0, 0.0, 0.0)
    picture[18:] = (0.0, 0.0, 1.0)
    for columns, rows, size in ((32, 40, (18, 32)), (200, 9, (18, 32)), (1, 1, (2, 1))):
        assert Preview(picture, columns, rows).pixels.shape[:2] == size
    console = Console(force_terminal=True, color_system="truecolor", width=80)
    lines = console.render_lines(Preview(picture, 16, 40), pad=False)
    assert len(lines) == 4
    colours = [line[0].style.color.triplet for line in lines if line[0].style]
    assert colours[0] == (255, 0, 0)
    assert lines[-1][0].style.bgcolor.triplet == (0, 0, 255)


def test_a_preview_needs_a_terminal_with_colours():
    assert can_preview(Console(force_terminal=True, color_system="truecolor"))
    assert not can_preview(Console(force_terminal=True, color_system="standard"))
    assert not can_preview(Console(force_terminal=False, color_system="truecolor"))


class Counted(LineScreen):
    """A screen that remembers at which step it was shown a picture."""

    def __init__(self):
        super().__init__(Console(file=io.StringIO()), preview=False, interactive=False)
        self.steps = []

    def show(self, drawn):
        self.steps.append(drawn.session.steps)


def test_of_camera_keys_that_wait_only_the_last_is_drawn_but_every_step_is(tmp_path):
    world = small_world.small_environment()
    state = EnvironmentState(
        {
            name: ObjectState(codes.position[0], codes.style[0], codes.pose[0])
            for name, codes in small_world.random_codes(world.config).items()
        }
    )
    (tmp_path / "state.json").write_text(json.dumps(state_as_dict(state)))
    start = Start(state=str(tmp_path / "state.json")), small_world.camera()
    stage = set_stage(world, "small", start, learnt_actions(world), Wishes())
    live, screen = LivePlay(world, stage, tmp_path), Counted()
    pressed, sent = os.pipe()
    os.write(sent, b"ddd22dd")
    os.close(sent)
    LiveLoop(live, mp4=False).follow(Keys(pressed), screen, forgiving=False)
    os.close(pressed)
    # A pipe that was closed is ready to be read, so even the last camera key looks followed.
    assert screen.steps == [0, 1, 2]
    assert [moment.move.orbit for moment in live.session.moments] == [15.0, 15.0, 25.0]
    assert live.abandon().frames == (2,)
    assert live.save().frames == finished_frames(world, shot_of_session(live.session), live.folder)


class Played:
    """`pe play` in a process of its own, in a pseudo-terminal."""

    def __init__(self, folder, *options):
        tiny_model.write_model(folder / "tiny.safetensors")
        tiny_model.write_clip(folder / "tiny_clip")
        self.keyboard, program = pty.openpty()
        termios.tcsetwinsize(program, (40, 100))
        self.before = termios.tcgetattr(program)
        self.program = program
        self.seen = b""
        command = [sys.executable, "-m", "pe_runtime.cli", "play", "-o", str(folder / "out")]
        command += ["--model", str(folder / "tiny.safetensors"), *options]
        colours = {"TERM": "xterm-256color", "COLORTERM": "truecolor", "PYTHONPATH": str(ROOT)}
        self.process = subprocess.Popen(
            command,
            stdin=program,
            stdout=subprocess.PIPE,
            stderr=program,
            env=os.environ | colours,
            # A terminal of its own, so that its Ctrl-C is a signal to this process alone.
            start_new_session=True,
            preexec_fn=lambda: _take(program),
        )

    def wait_for(self, *words):
        """Read what the screen shows until all the words have been shown."""
        end = time.monotonic() + PATIENCE
        while not all(word.encode() in self.seen for word in words):
            assert time.monotonic() < end, self.seen.decode(errors="replace")
            assert self.process.poll() is None, self.seen.decode(errors="replace")
            if select.select([self.keyboard], [], [], 0.1)[0]:
                self.seen += os.read(self.keyboard, 1 << 16)

    def press(self, keys):
        self.seen = b""
        os.write(self.keyboard, keys)

    def end(self):
        """Exit code and what the program wrote on stdout."""
        while self.process.poll() is None:
            if select.select([self.keyboard], [], [], 0.1)[0]:
                self.seen += os.read(self.keyboard, 1 << 16)
        out = self.process.stdout.read().decode()
        self.process.stdout.close()
        assert termios.tcgetattr(self.program) == self.before
        os.close(self.program)
        os.close(self.keyboard)
        return self.process.returncode, out


def _take(descriptor):
    """Make a terminal the process's own: a bare system call, safe between fork and exec."""
    fcntl.ioctl(descriptor, termios.TIOCSCTTY, 0)


def test_pressed_keys_play_and_the_terminal_is_given_back(tmp_path):
    played = Played(tmp_path, "--json")
    played.wait_for("idle", "save and quit", "▀", "0001.png")
    played.press(b"2")
    played.wait_for("step 1: player_1 left")
    played.press(b"\x1b[C")
    played.wait_for("camera +5")
    played.press(b"z")
    played.wait_for("no key 'z'")
    played.press(b"\t3")
    played.wait_for("step 2: player_1 idle, player_2 right")
    played.press(b"q")
    code, out = played.end()
    take = json.loads(out)["takes"][0]
    assert (code, take["frames"]) == (0, [1, 2, 3])
    assert sorted(path.name for path in Path(take["folder"]).iterdir()) == [
        "0001.png", "0002.png", "0003.png", "shot.json",
    ]  # fmt: skip


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_gives_the_terminal_back_and_keeps_the_take(tmp_path, number, code):
    played = Played(tmp_path, "--no-preview")
    played.wait_for("save and quit")
    assert "▀".encode() not in played.seen
    played.press(b"2")
    played.wait_for("step 1")
    if number == signal.SIGINT:
        played.press(b"\x03")
    else:
        played.process.send_signal(number)
    assert played.end()[0] == code
    assert sorted(path.name for path in (tmp_path / "out" / "take_1").iterdir()) == [
        "0001.png", "0002.png", "shot.json",
    ]  # fmt: skip
