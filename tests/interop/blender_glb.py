"""In Blender: imports the coloured mesh as GLB and compares its colours with the truth.
Usage: blender -b --factory-startup -P blender_glb.py -- FOLDER"""
import sys
import warnings

import bpy
import numpy

# The importer of Blender 3.4 uses a name that later versions of numpy have dropped.
with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    if not hasattr(numpy, "bool"):
        numpy.bool = bool

folder = sys.argv[sys.argv.index("--") + 1]
bpy.ops.object.select_all(action="SELECT")
bpy.ops.object.delete()
bpy.ops.import_scene.gltf(filepath=f"{folder}/sphere.glb")
mesh = next(o for o in bpy.context.scene.objects if o.type == "MESH")
assert len(mesh.data.polygons) > 1000
colours = mesh.data.color_attributes[0]
worst = 0.0
for corner, colour in zip(mesh.data.loops, colours.data):
    # The importer turns glTF's y to Blender's z.
    x, y, z = mesh.data.vertices[corner.vertex_index].co.normalized()
    worst = max(worst, max(abs(c - 0.5 * (1 + o)) for c, o in zip(colour.color_srgb, (x, z, -y))))
assert worst < 0.03, worst
nodes = mesh.data.materials[0].node_tree.nodes
assert any(node.type == "VERTEX_COLOR" for node in nodes), "the material shows no colours"
print(f"interop: {len(mesh.data.polygons)} triangles, colours within {255 * worst:.1f}/255")
