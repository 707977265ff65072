"""The frames of a prepared shot: overrides, rendering, and a digest of all that goes in."""

import hashlib
import json
from collections.abc import Callable, Iterable, Iterator

import torch

from pe_runtime.config import as_dict
from pe_runtime.contract.errors import PlayableEnvironmentError, ShotError
from pe_runtime.contract.shot import Shot
from pe_runtime.environment import Frame, RenderOptions
from pe_runtime.shots.rollout import PreparedShot, World
from pe_runtime.state import EnvironmentState, hide, move, repose, restyle, turn

RENDERER_VERSION = 1
"""Raise when the same inputs give other pixels, so that stored frames are drawn again."""

OnProgress = Callable[[int, int], object]
"""Called with the number of frames done and their total."""
ShouldStop = Callable[[], bool]


class RenderCancelledError(PlayableEnvironmentError):
    """Rendering stopped because it was asked to; finished frames are kept."""


def frame_state(prepared: PreparedShot, frame: int) -> EnvironmentState:
    """What stands where in a frame: the prediction with the shot's overrides applied."""
    state = predicted = prepared.rollout.at(frame)
    index = frame - prepared.shot.frame_start
    for track in prepared.shot.objects:
        own = predicted[track.name]
        if track.locations is not None:
            place = torch.tensor(track.locations[index], dtype=own.position.dtype)
            state = move(state, track.name, place.to(own.position.device))
        if track.headings is not None:
            state = turn(state, track.name, track.headings[index])
        if track.visible is not None and not track.visible[index]:
            state = hide(state, track.name)
        held = track.pose_at(frame)
        if held is not None:
            state = repose(state, track.name, prepared.rollout.at(held)[track.name].pose)
        mixes = track.styles_at(frame)
        if any(mix.weight > 0 for mix in mixes):
            style = own.style * (1.0 - sum(mix.weight for mix in mixes))
            for mix in mixes:
                lent = prepared.lenders[mix.image][mix.object].style
                style = style + mix.weight * lent.to(style.device)
            state = restyle(state, track.name, style)
    return state


def select_frames(shot: Shot, frames: Iterable[int] | None) -> list[int]:
    """The wanted frames in order; all of them for None.

    Raises:
        ShotError: A frame lies outside the shot.
    """
    wanted = sorted(set(shot.frames if frames is None else frames))
    outside = [frame for frame in wanted if frame not in shot.frames]
    if outside:
        raise ShotError(
            f"frames {outside} are not in the shot; it has frames {shot.frame_start} to "
            f"{shot.frame_end}"
        )
    return wanted


def render_options(shot: Shot) -> RenderOptions:
    """Quality, region and passes of a shot, as the environment takes them."""
    return RenderOptions(
        quality=shot.quality,
        depth=shot.wants_depth,
        masks=shot.mask_names,
        region=shot.region,
        layers=shot.layer_names,
        background=shot.wants_background,
    )


def render_frames(
    world: World,
    prepared: PreparedShot,
    frames: Iterable[int] | None = None,
    on_progress: OnProgress | None = None,
    should_stop: ShouldStop | None = None,
) -> Iterator[tuple[int, Frame]]:
    """Draw frames one by one; each depends on nothing but the shot.

    Yields:
        Frame number and picture.

    Raises:
        RenderCancelledError: `should_stop` said so before a frame.
        ShotError: A frame lies outside the shot.
    """
    wanted = select_frames(prepared.shot, frames)
    options = render_options(prepared.shot)
    for done, frame in enumerate(wanted):
        if should_stop is not None and should_stop():
            raise RenderCancelledError(f"cancelled after {done} of {len(wanted)} frames")
        camera = prepared.shot.camera_at(frame)
        yield frame, world.render(frame_state(prepared, frame), camera, options)
        if on_progress is not None:
            on_progress(done + 1, len(wanted))


def model_digest(world: World) -> str:
    """SHA-256 over the configuration and the weights that draw, in hex."""
    digest = hashlib.sha256(json.dumps(as_dict(world.config), sort_keys=True).encode())
    for name, weights in sorted(world.networks.state_dict().items()):
        digest.update(name.encode())
        digest.update(weights.detach().cpu().numpy().tobytes())
    return digest.hexdigest()


def frame_digest(model: str, prepared: PreparedShot, frame: int) -> str:
    """SHA-256 over everything that decides a frame's pixels, in hex.

    Args:
        model: What `model_digest` says of the world.
        prepared: The shot.
        frame: Frame number.
    """
    shot = prepared.shot
    content = {
        "renderer": RENDERER_VERSION,
        "model": model,
        "camera": shot.camera_at(frame).as_dict(),
        "quality": shot.quality,
        "passes": shot.passes,
    }
    # Left out where there is none: files that were drawn before regions were known stay current.
    content |= {} if shot.region is None else {"region": shot.region}
    digest = hashlib.sha256(json.dumps(content, sort_keys=True).encode())
    state = frame_state(prepared, frame)
    for name in sorted(state.objects):
        each = state[name]
        turned = f" {each.heading!r}" if each.heading else ""
        digest.update(f"{name} {each.visible}{turned}".encode())
        for code in (each.position, each.style, each.pose):
            digest.update(code.detach().cpu().numpy().tobytes())
    return digest.hexdigest()
