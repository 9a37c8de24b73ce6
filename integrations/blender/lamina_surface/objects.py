"""Results of a run as objects in the scene."""

import bpy
import numpy as np

COLOURS = "Colour"
OFFSET = "lamina_offset"
FAR = 100  # Times its size from the origin, an object's vertices would tremble in floats.


def _material():
    """Shows the colours of any mesh of ours; one serves all."""
    name = "Lamina colours"
    made = bpy.data.materials.get(name)
    if made:
        return made
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    nodes = made.node_tree.nodes
    shader = nodes["Principled BSDF"]
    shader.inputs["Roughness"].default_value = 0.8
    colours = nodes.new("ShaderNodeVertexColor")
    colours.layer_name = COLOURS
    colours.location = (shader.location.x - 220, shader.location.y)
    made.node_tree.links.new(colours.outputs["Color"], shader.inputs["Base Color"])
    return made


def _add_colours(data, mesh):
    if mesh.bytes_per_colour == 1:
        layer = data.color_attributes.new(COLOURS, "BYTE_COLOR", "POINT")
        layer.data.foreach_set("color_srgb", mesh.colours.ravel())
    else:
        layer = data.color_attributes.new(COLOURS, "FLOAT_COLOR", "POINT")
        srgb = mesh.colours[:, :3]
        mesh.colours[:, :3] = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
        layer.data.foreach_set("color", mesh.colours.ravel())
    data.color_attributes.active_color = layer
    data.materials.append(_material())


def add_mesh(name, mesh, colours=True):
    """A mesh of whole arrays, with its normals as custom ones."""
    data = bpy.data.meshes.new(name)
    corners = mesh.triangles.size
    data.vertices.add(len(mesh.vertices))
    data.vertices.foreach_set("co", mesh.vertices.ravel())
    data.loops.add(corners)
    data.loops.foreach_set("vertex_index", mesh.triangles.ravel())
    data.polygons.add(len(mesh.triangles))
    data.polygons.foreach_set("loop_start", np.arange(0, corners, 3, dtype=np.int32))
    if bpy.app.version < (3, 6, 0):  # Later ones know it from the starts.
        data.polygons.foreach_set("loop_total", np.full(len(mesh.triangles), 3, dtype=np.int32))
    data.polygons.foreach_set("use_smooth", np.ones(len(mesh.triangles), dtype=bool))
    data.update(calc_edges=True)
    if mesh.normals is not None:
        if bpy.app.version < (4, 1, 0):
            data.use_auto_smooth = True
        data.normals_split_custom_set_from_vertices(mesh.normals)
    if colours and mesh.colours is not None:
        _add_colours(data, mesh)
    return bpy.data.objects.new(name, data)


def add_volume(name, path):
    data = bpy.data.volumes.new(name)
    data.filepath = path
    return bpy.data.objects.new(name, data)


def place(context, objects, shift, size):
    """Puts objects whose coordinates were written less `shift` where they belong.

    Far from the origin (georeferenced coordinates) the scene gets an offset, the first such object's, and everything that
    follows is placed relative to it, so that neighbours meet. The true position of a point is its position in the scene
    plus the object's property `lamina_offset`.
    """
    scene = context.scene
    far = max(abs(x) for x in shift) > FAR * size
    if far and OFFSET not in scene:
        scene[OFFSET] = shift
    offset = tuple(scene.get(OFFSET, (0.0, 0.0, 0.0))) if far else (0.0, 0.0, 0.0)
    for made in objects:
        made.location = [s - o for s, o in zip(shift, offset)]
        made[OFFSET] = offset
        context.collection.objects.link(made)
