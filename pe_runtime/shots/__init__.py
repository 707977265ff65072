"""Run a Shot: encode its start, roll the actions out, draw its frames, write them to disk."""

from pe_runtime.shots.files import RenderReport, frame_path, load_shot, render_shot
from pe_runtime.shots.frames import RenderCancelledError, frame_state, render_frames
from pe_runtime.shots.rollout import (
    PreparedShot,
    Rollout,
    prepare_shot,
    prepared_from,
    read_state,
    rollout,
    rollout_key,
    start_state,
)

__all__ = [
    "PreparedShot",
    "RenderCancelledError",
    "RenderReport",
    "Rollout",
    "frame_path",
    "frame_state",
    "load_shot",
    "prepare_shot",
    "prepared_from",
    "read_state",
    "render_frames",
    "render_shot",
    "rollout",
    "rollout_key",
    "start_state",
]
