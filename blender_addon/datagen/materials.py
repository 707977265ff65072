"""Flat, noise-free shading for recorded scenes: a sun without size plus a glow of each surface.

The glow stands for light from all around. It is not the world lighting the scene, because that
would have to be sampled and would leave noise in the pictures.
"""

import bpy
import numpy as np

from blender_addon.datagen.appearance import Colour, linear

GLOW = 0.58
GLOW_SLOPE = 0.14
VEIL_COVER = 0.42  # below one half, where Cycles writes id and depth of what is behind
# Where the glow is strongest: tells the sides of a box apart without a second light.
GLOW_FROM = np.array([-0.55, -0.75, 0.35]) / np.linalg.norm([-0.55, -0.75, 0.35])


class Palette:
    """Materials of the current file, one per colour."""

    def __init__(self) -> None:
        self._materials: dict[Colour, bpy.types.Material] = {}

    def flat(self, colour: Colour) -> bpy.types.Material:
        """The diffuse material of an sRGB colour."""
        if colour not in self._materials:
            self._materials[colour] = _flat_material(colour)
        return self._materials[colour]

    def veil(self, colour: Colour) -> bpy.types.Material:
        """A film of an sRGB colour through which the id and the depth behind it are seen."""
        return _veil_material(colour)


def make_sky(scene: bpy.types.Scene, horizon: Colour, zenith: Colour) -> None:
    """A sky that fades from `horizon` up to `zenith` and lights nothing."""
    world = bpy.data.worlds.new("sky")
    scene.world = world
    world.cycles_visibility.diffuse = False
    world.cycles.sampling_method = "NONE"
    nodes, links = _emptied(world)
    direction = nodes.new("ShaderNodeTexCoord")
    split = nodes.new("ShaderNodeSeparateXYZ")
    ramp = nodes.new("ShaderNodeValToRGB")
    background = nodes.new("ShaderNodeBackground")
    output = nodes.new("ShaderNodeOutputWorld")
    ramp.color_ramp.elements[0].color = linear(horizon)
    ramp.color_ramp.elements[1].color = linear(zenith)
    ramp.color_ramp.elements[1].position = 0.5
    links.new(direction.outputs["Generated"], split.inputs[0])
    links.new(split.outputs["Z"], ramp.inputs[0])
    links.new(ramp.outputs["Color"], background.inputs["Color"])
    links.new(background.outputs[0], output.inputs["Surface"])


def forbid_bounces(scene: bpy.types.Scene) -> None:
    """Let light reach surfaces straight from the sun only.

    Even without bounces Cycles follows one diffuse ray and adds the glow it meets: noise.
    """
    scene.cycles.max_bounces = 0
    for part in scene.objects:
        if part.type == "MESH":
            part.visible_diffuse = part.visible_glossy = False


def _flat_material(colour: Colour) -> bpy.types.Material:
    material = bpy.data.materials.new("flat")
    # Else every surface would be one of many lights to choose from: noise, and slow.
    material.cycles.emission_sampling = "NONE"
    nodes, links = _emptied(material)
    diffuse = nodes.new("ShaderNodeBsdfDiffuse")
    glow = nodes.new("ShaderNodeEmission")
    both = nodes.new("ShaderNodeAddShader")
    output = nodes.new("ShaderNodeOutputMaterial")
    diffuse.inputs["Color"].default_value = linear(colour)
    glow.inputs["Color"].default_value = linear(colour)
    links.new(_glow_strength(nodes, links), glow.inputs["Strength"])
    links.new(diffuse.outputs[0], both.inputs[0])
    links.new(glow.outputs[0], both.inputs[1])
    links.new(both.outputs[0], output.inputs["Surface"])
    return material


def _veil_material(colour: Colour) -> bpy.types.Material:
    material = bpy.data.materials.new("veil")
    material.cycles.emission_sampling = "NONE"
    nodes, links = _emptied(material)
    glow = nodes.new("ShaderNodeEmission")
    clear = nodes.new("ShaderNodeBsdfTransparent")
    mix = nodes.new("ShaderNodeMixShader")
    output = nodes.new("ShaderNodeOutputMaterial")
    glow.inputs["Color"].default_value = linear(colour)
    # No diffuse part: light would have to choose between the two, and leave noise.
    mix.inputs["Fac"].default_value = 1 - VEIL_COVER
    links.new(glow.outputs[0], mix.inputs[1])
    links.new(clear.outputs[0], mix.inputs[2])
    links.new(mix.outputs[0], output.inputs["Surface"])
    return material


def _glow_strength(nodes: bpy.types.Nodes, links: bpy.types.NodeLinks) -> bpy.types.NodeSocket:
    geometry = nodes.new("ShaderNodeNewGeometry")
    facing = nodes.new("ShaderNodeVectorMath")
    facing.operation = "DOT_PRODUCT"
    facing.inputs[1].default_value = GLOW_FROM.tolist()
    strength = nodes.new("ShaderNodeMath")
    strength.operation = "MULTIPLY_ADD"
    strength.inputs[1].default_value = GLOW_SLOPE
    strength.inputs[2].default_value = GLOW
    links.new(geometry.outputs["Normal"], facing.inputs[0])
    links.new(facing.outputs["Value"], strength.inputs[0])
    return strength.outputs[0]


def _emptied(
    owner: bpy.types.Material | bpy.types.World,
) -> tuple[bpy.types.Nodes, bpy.types.NodeLinks]:
    if bpy.app.version < (5, 0, 0):
        owner.use_nodes = True
    owner.node_tree.nodes.clear()
    return owner.node_tree.nodes, owner.node_tree.links
