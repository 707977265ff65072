"""Compositor nodes, across Blender's two ways of keeping them (a node group since 5.0)."""

import bpy


class Compositor:
    """The nodes of a scene, emptied first; what `shows` is called with is what is rendered.

    Args:
        scene: Gets the nodes.
    """

    def __init__(self, scene: bpy.types.Scene) -> None:
        self._grouped = "compositing_node_group" in scene.bl_rna.properties
        if self._grouped:
            self._tree = bpy.data.node_groups.new(f"{scene.name} Compositing", "CompositorNodeTree")
            self._tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
            scene.compositing_node_group = self._tree
        else:
            scene.use_nodes = True
            self._tree = scene.node_tree
            self._tree.nodes.clear()
        scene.render.use_compositing = True

    def layer(self, scene: bpy.types.Scene, layer: str) -> bpy.types.Node:
        """What a view layer of a scene renders."""
        node = self._tree.nodes.new("CompositorNodeRLayers")
        node.scene, node.layer = scene, layer
        return self._placed(node)

    def over(
        self,
        below: bpy.types.NodeSocket,
        above: bpy.types.NodeSocket,
        share: bpy.types.NodeSocket,
    ) -> bpy.types.NodeSocket:
        """One picture over another, as much as the share says."""
        node = self._placed(self._tree.nodes.new("CompositorNodeAlphaOver"))
        # Blender 5.0 named the sockets and moved the factor.
        names = {"Background": below, "Foreground": above, "Factor": share}
        for place, (name, source) in enumerate(names.items()):
            target = node.inputs.get(name) or node.inputs[(place + 1) % 3]
            self._tree.links.new(source, target)
        return node.outputs[0]

    def nearest(
        self, one: bpy.types.Node, other: bpy.types.Node, picture: bpy.types.NodeSocket
    ) -> bpy.types.NodeSocket:
        """Per pixel whichever of two layers is nearer, the other where both are equally far.

        Args:
            one: Gives picture and depth.
            other: Gives depth.
            picture: What the other shows.
        """
        node = self._placed(self._tree.nodes.new("CompositorNodeZcombine"))
        sources = one.outputs["Image"], one.outputs["Depth"], picture, other.outputs["Depth"]
        for source, target in zip(sources, node.inputs, strict=False):
            self._tree.links.new(source, target)
        return node.outputs[0]

    def without(self, masks: list[bpy.types.NodeSocket]) -> bpy.types.NodeSocket:
        """1 where none of the masks covers anything, 0 where one covers all."""
        kind = "ShaderNodeMath" if self._grouped else "CompositorNodeMath"
        left = None
        for mask in masks:
            node = self._placed(self._tree.nodes.new(kind))
            node.operation, node.use_clamp = "SUBTRACT", True
            node.inputs[0].default_value = 1.0
            if left is not None:
                self._tree.links.new(left, node.inputs[0])
            self._tree.links.new(mask, node.inputs[1])
            left = node.outputs[0]
        return left

    def shows(self, picture: bpy.types.NodeSocket) -> None:
        """Make this the scene's picture."""
        kind = "NodeGroupOutput" if self._grouped else "CompositorNodeComposite"
        node = self._placed(self._tree.nodes.new(kind))
        self._tree.links.new(picture, node.inputs[0])

    def _placed(self, node: bpy.types.Node) -> bpy.types.Node:
        """A node where an artist who opens the file can read it: left to right."""
        node.location = 260 * (len(self._tree.nodes) - 1), 0
        return node
