"""A session as a value: moments of a take, and how each command makes the next session of it.

Nothing here draws, prints or waits. Undo is going back to the value before.
"""

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from pe_runtime.contract.errors import ShotError
from pe_runtime.contract.shot import StyleMix
from pe_runtime.play.camera_moves import CameraMove, moved_camera
from pe_runtime.play.commands import Command
from pe_runtime.play.stage import Stage
from pe_runtime.shots.rollout import World
from pe_runtime.state import EnvironmentState

CAMERA_MOVES = {
    "orbit": CameraMove(orbit=5.0),
    "rise": CameraMove(rise=0.25),
    "dolly": CameraMove(dolly=0.5),
}
"""What one press moves: degrees or metres."""


@dataclass(frozen=True)
class Moment:
    """One frame of the take at which the model stepped.

    Attributes:
        state: Where everything is, in its own styles.
        memory: What the dynamics networks remember after it.
        told: Actions that led here, by player; empty at the start.
        move: How far the camera has moved since the start.
        styles: What players wear other than their own style.
    """

    state: EnvironmentState
    memory: Any = field(default=None, repr=False)
    told: Mapping[str, int] = field(default_factory=dict)
    move: CameraMove = CameraMove()
    styles: Mapping[str, StyleMix] = field(default_factory=dict)


@dataclass(frozen=True)
class Session:
    """A take so far, and who is being played.

    Attributes:
        stage: What stays the same.
        moments: The take: its start, then one moment per step.
        playing: Index of the player whose actions the keys are; the number of players for all.
        pending: In turn: actions of those who have been told already.
        before: The session that undo goes back to.
    """

    stage: Stage
    moments: tuple[Moment, ...]
    playing: int = 0
    pending: tuple[int, ...] = ()
    before: "Session | None" = field(default=None, repr=False, compare=False)

    @property
    def now(self) -> Moment:
        """The latest moment."""
        return self.moments[-1]

    @property
    def in_turn(self) -> bool:
        """Whether every player is told before a step is taken."""
        return self.playing == len(self.stage.players)

    @property
    def player(self) -> str:
        """Whom the next action is for."""
        index = len(self.pending) if self.in_turn else self.playing
        return self.stage.players[index]

    @property
    def steps(self) -> int:
        """Steps taken."""
        return len(self.moments) - 1

    def arrows(self) -> tuple[str, ...]:
        """Where the actions of the next one to act lead in the picture; empty for nowhere."""
        stage, now = self.stage, self.now
        camera = moved_camera(stage.camera, stage.pivot, now.move)
        heading = now.state[self.player].heading
        return tuple(each.arrow(camera, heading) for each in stage.actions[self.player])


def begin(stage: Stage, playing: int = 0) -> Session:
    """A new take."""
    return Session(stage, (Moment(stage.state, styles=stage.wishes.styles),), playing)


def obey(world: World, session: Session, command: Command) -> Session:
    """The session after a command.

    Args:
        world: The loaded environment.
        session: The session before; it stays as it is.
        command: Any command that changes the take or who is played; those about files and the
            screen ("film", "keys", "quit") change nothing here.

    Raises:
        ShotError: The command makes no sense now; the message says what does.
    """
    change = CHANGES.get(command.verb)
    return session if change is None else change(world, session, command)


def _act(world: World, session: Session, command: Command) -> Session:
    if not session.in_turn:
        return _step(world, session, {**session.stage.resting, session.player: command.amount})
    pending = (*session.pending, command.amount)
    if len(pending) < len(session.stage.players):
        return dataclasses.replace(session, pending=pending)
    return _step(world, session, dict(zip(session.stage.players, pending, strict=True)))


def _again(world: World, session: Session, command: Command) -> Session:
    if not session.now.told:
        raise ShotError("nothing has been done yet that could be done again")
    return _step(world, session, session.now.told)


def _step(world: World, session: Session, told: Mapping[str, int]) -> Session:
    now = session.now
    camera = moved_camera(session.stage.camera, session.stage.pivot, now.move)
    state, memory = world.step(now.state, told, camera, now.memory)
    after = Moment(state, memory, told, now.move, now.styles)
    moments = (*session.moments, after)
    return dataclasses.replace(session, moments=moments, pending=(), before=session)


def _change_now(session: Session, **changes: Any) -> Session:  # noqa: ANN401
    """The session with the latest moment seen otherwise."""
    now = dataclasses.replace(session.now, **changes)
    return dataclasses.replace(session, moments=(*session.moments[:-1], now), before=session)


def _move_camera(world: World, session: Session, command: Command) -> Session:
    move = CAMERA_MOVES[command.verb] * float(command.amount)
    return _change_now(session, move=session.now.move + move)


def _recentre(world: World, session: Session, command: Command) -> Session:
    return _change_now(session, move=CameraMove())


def _borrow(world: World, session: Session, command: Command) -> Session:
    """The style of the next other player who can lend one; after the last, the own."""
    player, styles = session.player, session.now.styles
    lenders = lenders_of(world, session.stage, player)
    if not lenders:
        raise ShotError(f"nobody else in the picture has a style that fits {player}")
    worn = styles[player].object if player in styles else None
    position = lenders.index(worn) + 1 if worn in lenders else 0
    if position == len(lenders):
        return _own(world, session, command)
    mix = StyleMix(1, None, lenders[position], 1.0)
    return _change_now(session, styles={**styles, player: mix})


def _own(world: World, session: Session, command: Command) -> Session:
    kept = {name: mix for name, mix in session.now.styles.items() if name != session.player}
    return _change_now(session, styles=kept)


def _next_player(world: World, session: Session, command: Command) -> Session:
    players = len(session.stage.players)
    choices = players + 1 if players > 1 else 1
    return dataclasses.replace(session, playing=(session.playing + 1) % choices, pending=())


def _undo(world: World, session: Session, command: Command) -> Session:
    if session.pending:
        return dataclasses.replace(session, pending=session.pending[:-1])
    if session.before is None:
        raise ShotError("this is where the take began; there is nothing to undo")
    return dataclasses.replace(session.before, playing=session.playing, pending=())


def _new(world: World, session: Session, command: Command) -> Session:
    return begin(session.stage, session.playing)


CHANGES: dict[str, Callable[[World, Session, Command], Session]] = {
    "act": _act,
    "again": _again,
    "player": _next_player,
    "orbit": _move_camera,
    "rise": _move_camera,
    "dolly": _move_camera,
    "recentre": _recentre,
    "borrow": _borrow,
    "own": _own,
    "undo": _undo,
    "new": _new,
}
"""What each verb makes of a session."""


def lenders_of(world: World, stage: Stage, player: str) -> tuple[str, ...]:
    """Other players in the picture of the same class: their styles fit."""
    classes = {each.name: each.class_name for each in world.config.objects}
    own = stage.state[player].style
    return tuple(
        name
        for name in stage.players
        if name != player
        and classes.get(name) == classes.get(player)
        and stage.state[name].style.shape == own.shape
    )
