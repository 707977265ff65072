"""The volumes of a model's objects as wire boxes in the viewport; renders never show them.

A playable object's box hangs on its Empty and moves and turns with it; those of the court and other
static objects hang on the environment root.
"""

from collections.abc import Iterator, Mapping

import bpy
import numpy as np

from pe_runtime.contract.model_facts import ModelFacts, Volume

VOLUME_KEY = "playable_environment_volume"
FACES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))


def show_volumes(
    scene: bpy.types.Scene,
    facts: ModelFacts,
    playables: Mapping[str, bpy.types.Object],
    state: Mapping,
) -> None:
    """Give every object of an environment its box, in place of those it had before.

    Args:
        scene: The scene with the environment.
        facts: The model's.
        playables: The Empties of those playable objects that are in the picture.
        state: The worker's state, for the places of static objects.
    """
    for each in [each for each in scene.objects if VOLUME_KEY in each]:
        bpy.data.meshes.remove(each.data)
    for name, volume in facts.volumes.items():
        if name in facts.playable_names:
            if name in playables:
                _new_box(scene, name, volume, playables[name])
        else:
            box = _new_box(scene, name, volume, scene.playable_environment.root)
            box.location = state["objects"][name]["position"]


def volumes_in(scene: bpy.types.Scene) -> dict[str, Volume]:
    """The volumes of a scene's boxes by their objects' names in the model."""
    found = {}
    for each in scene.objects:
        if each.type == "MESH" and VOLUME_KEY in each:
            corners = np.empty(3 * len(each.data.vertices), np.float32)
            each.data.vertices.foreach_get("co", corners)
            corners = corners.reshape(-1, 3).astype(float)
            if len(corners):
                low, high = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
                found[each[VOLUME_KEY]] = Volume(tuple(low), tuple(high))
    return found


def height_of(volume: Volume | None, otherwise: float) -> float:
    """Metres from the lowest to the highest point of a volume."""
    return otherwise if volume is None else volume.high[2] - volume.low[2]


def farthest(facts: ModelFacts, state: Mapping, eye: np.ndarray) -> float:
    """Metres from a point (3,) of environment space to the farthest corner of any volume."""
    corners = list(_corners(facts, state))
    return max((float(np.linalg.norm(corner - eye)) for corner in corners), default=0.0)


def _corners(facts: ModelFacts, state: Mapping) -> Iterator[np.ndarray]:
    for name, volume in facts.volumes.items():
        place = np.array(state["objects"][name]["position"])
        yield from place + np.array(_vertices(volume))


def _vertices(volume: Volume) -> list[tuple[float, float, float]]:
    sides = zip(volume.low, volume.high, strict=True)
    xs, ys, zs = sides
    return [(x, y, z) for x in xs for y in ys for z in zs]


def _new_box(
    scene: bpy.types.Scene, name: str, volume: Volume, holder: bpy.types.Object
) -> bpy.types.Object:
    mesh = bpy.data.meshes.new(f"{name} volume")
    mesh.from_pydata(_vertices(volume), [], FACES)
    box = bpy.data.objects.new(f"{name} volume", mesh)
    box[VOLUME_KEY] = name
    box.parent, box.display_type = holder, "WIRE"
    # Clicks are meant for the Empty inside.
    box.hide_render = box.hide_select = True
    scene.collection.objects.link(box)
    return box
