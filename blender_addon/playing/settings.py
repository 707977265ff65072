"""How a scene's playable objects are played; kept with the scene."""

import bpy
from bpy.props import BoolProperty


class PlayingSettings(bpy.types.PropertyGroup):
    """On a scene: whether the paths follow the keys by themselves."""

    update_paths: BoolProperty(
        name="Update Paths Automatically",
        description=(
            "After an action key, the camera, the range or the pace was changed, let the model act "
            "it out again from that frame on and key the new paths"
        ),
        default=True,
        options=set(),
        override={"LIBRARY_OVERRIDABLE"},
    )
