"""What a scene keeps of how its range is rendered and where its strip goes."""

import bpy
from bpy.props import BoolProperty, IntProperty, PointerProperty


def _is_not_linked(_self: object, candidate: bpy.types.Scene) -> bool:
    return candidate.library is None


class StripSettings(bpy.types.PropertyGroup):
    """On a scene: its range as a job, and the job's strip."""

    target: PointerProperty(
        name="Scene",
        description="Scene whose sequencer gets the strip; empty for one of its own, "
        "named after this scene with Edit behind it",
        type=bpy.types.Scene,
        poll=_is_not_linked,
    )
    channel: IntProperty(
        name="Channel",
        description="Lowest channel for a new strip, which takes the first one from there on that "
        "is free at its time. A strip that is there already stays on its channel",
        min=1,
        max=128,
        default=1,
    )
    frame_offset: IntProperty(
        name="Start Offset",
        description="Frames by which the strip starts later than the pictures' own frame numbers",
        default=0,
    )
    only_changed: BoolProperty(
        name="Only Changes",
        description="Render the frames that are missing or would look different now; "
        "off: render every frame again",
        default=True,
    )
    share_scene: BoolProperty(
        name="Leave Sequencer Out",
        description="Allow a strip in a scene that has an environment. Rendering that scene then "
        "shows the environment and never its sequencer, which is switched off in Post Processing",
        default=False,
    )
