"""Play a model by hand or by script: sessions as values, camera moves, and the Shots they make."""

from pe_runtime.play.camera_moves import CameraMove, moved_camera
from pe_runtime.play.learnt_actions import learnt_actions
from pe_runtime.play.live import LivePlay, SavedTake
from pe_runtime.play.session import Moment, Session, begin, obey
from pe_runtime.play.stage import Stage, Wishes, set_stage
from pe_runtime.play.style_text import parse_styles
from pe_runtime.play.takes import finished_frames, shot_of_script, shot_of_session, write_shot

__all__ = [
    "CameraMove",
    "LivePlay",
    "Moment",
    "SavedTake",
    "Session",
    "Stage",
    "Wishes",
    "begin",
    "finished_frames",
    "learnt_actions",
    "moved_camera",
    "obey",
    "parse_styles",
    "set_stage",
    "shot_of_script",
    "shot_of_session",
    "write_shot",
]
