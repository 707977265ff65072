"""What of the overlay is switched on; kept with the scene."""

import bpy
from bpy.props import BoolProperty, IntProperty


def _switch(name: str, description: str, default: bool = True) -> object:
    # Not animatable: an overlay is for looking, and keys would only clutter the timeline.
    return BoolProperty(
        name=name,
        description=description,
        # Blender's own catalogue means something else by such words.
        translation_context="Playable",
        default=default,
        options=set(),
    )


class OverlaySettings(bpy.types.PropertyGroup):
    """On a scene: what is drawn over it in 3D viewports; renders never show it."""

    show: _switch("Overlay", "Draw the environment's marks in 3D viewports")
    grid: _switch("Ground Grid", "The ground on which the model knows players, in whole metres")
    boxes: _switch("Boxes", "The boxes of the players in the picture, with what is wrong with them")
    volumes: _switch("Volumes", "Where the players will stand, as the boxes say")
    points: _switch("Ground Points", "The points that place the camera, and by how much they miss")
    paths: _switch("Paths", "The ways that the players are going to take")
    steps: _switch("Steps", "A dot at every step of the model")
    actions: _switch("Actions", "The names of actions where they begin")
    headings: _switch("Headings", "Where players who turn are looking")
    players: _switch("Players", "The volume of every player in its colour, with its name")
    ghosts: _switch("Ghosts", "The players' volumes at steps before and after the current frame")
    ghosts_before: IntProperty(
        name="Before",
        description="Ghosts behind each player",
        default=1,
        min=0,
        max=24,
        options=set(),
    )
    ghosts_after: IntProperty(
        name="After",
        description="Ghosts ahead of each player",
        default=3,
        min=0,
        max=24,
        options=set(),
    )
    ghost_steps: IntProperty(
        name="Every",
        description="Steps of the model from one ghost to the next",
        default=2,
        min=1,
        soft_max=20,
        options=set(),
    )
