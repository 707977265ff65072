"""Which Empty stands for which playable object of the model, and who is left out."""

from collections.abc import Sequence

import bpy

from .stepping import playables_in


def other_claims(scene: bpy.types.Scene, target: bpy.types.Object) -> list[str]:
    """Names of the other Empties that stand for the same playable object."""
    name = target.playable.object_name
    same = (each for each in playables_in(scene) if each.playable.object_name == name)
    return [each.name for each in same if each != target]


def left_out(scene: bpy.types.Scene) -> list[str]:
    """Playable objects seen in the picture for which no Empty stands, in the model's order."""
    claimed = _claimed(scene)
    seen = scene.playable_environment.typed_boxes()
    return [name for name in seen if name not in claimed]


def free_names(scene: bpy.types.Scene, target: bpy.types.Object) -> list[str]:
    """Playable objects of the picture that a target could stand for: nobody else does."""
    seen = scene.playable_environment.typed_boxes()
    return [name for name in seen if name not in _claimed(scene, [target])]


def _claimed(scene: bpy.types.Scene, but: Sequence[bpy.types.Object] = ()) -> set[str]:
    return {each.playable.object_name for each in playables_in(scene) if each not in but}
