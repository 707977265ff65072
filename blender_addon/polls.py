"""What operators need before they can run; a greyed button says what is lacking."""

import bpy
from bpy.app.translations import pgettext_tip as tip_


def allowed(operator: type, condition: bool, why_not: str) -> bool:
    """The answer of a poll; where it is no, a greyed button says why."""
    if not condition:
        operator.poll_message_set(tip_(why_not))
    return condition


def rendering() -> bool:
    """Whether Blender renders; it counts the frames of an animation in the scene itself."""
    return bpy.app.is_job_running("RENDER")


def not_rendering(operator: type) -> bool:
    """Whether what goes through frames, or changes what is being rendered, may run."""
    return allowed(
        operator, not rendering(), "Wait until Blender has rendered, or stop it with Esc"
    )


def in_object_mode(operator: type, context: bpy.types.Context) -> bool:
    """Whether nobody is editing or posing anything."""
    return allowed(operator, context.mode == "OBJECT", "Leave edit or pose mode first")


def has_environment(operator: type, scene: bpy.types.Scene) -> bool:
    """Whether a scene has an environment."""
    made = scene.playable_environment.root is not None
    return allowed(operator, made, "Make a New Playable Environment first")


def has_bake(operator: type, scene: bpy.types.Scene) -> bool:
    """Whether a scene's paths are baked."""
    baked = scene.playable_environment.bake_text is not None
    return allowed(operator, baked, "Nothing is baked yet: press Bake Paths")


def playable_chosen(operator: type, chosen: bpy.types.Object | None) -> bool:
    """Whether an object, or none, is a playable one."""
    there = chosen is not None and chosen.playable.is_playable
    return allowed(operator, there, "Select a playable Empty first")
