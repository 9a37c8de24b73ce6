"""In Blender: imports the fog and the coloured mesh, checks them, renders both side by side with Cycles.
Usage: blender -b --factory-startup -P blender.py -- FOLDER"""
import sys

import bpy
from mathutils import Vector

folder = sys.argv[sys.argv.index("--") + 1]
bpy.ops.object.select_all(action="SELECT")
bpy.ops.object.delete()

bpy.ops.import_mesh.ply(filepath=f"{folder}/sphere.ply")
mesh = bpy.context.object
mesh.location.x = -1.15
assert len(mesh.data.polygons) > 1000
assert all(0.98 < v.co.length < 1.02 for v in mesh.data.vertices)
colours = mesh.data.color_attributes[0]
worst = 0.0
for corner, colour in zip(mesh.data.loops, colours.data):
    outward = mesh.data.vertices[corner.vertex_index].co.normalized()
    worst = max(worst, max(abs(c - 0.5 * (1 + o)) for c, o in zip(colour.color_srgb, outward)))
assert worst < 0.03, worst

bpy.ops.object.volume_import(filepath=f"{folder}/fog.vdb")
fog = bpy.context.object
fog.location.x = 1.15
assert fog.data.grids.load()
assert "density" in [grid.name for grid in fog.data.grids]
size = max(fog.dimensions)
assert 1.9 < size < 2.2, size


def material(name, source, target, socket):
    """One shader fed into one socket of the material's output."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    nodes, links = made.node_tree.nodes, made.node_tree.links
    nodes.clear()
    shader = nodes.new(target)
    links.new(shader.outputs[0], nodes.new("ShaderNodeOutputMaterial").inputs[socket])
    if source:
        attribute = nodes.new("ShaderNodeVertexColor")
        attribute.layer_name = source
        links.new(attribute.outputs[0], shader.inputs[0])
    return made, shader


painted, _ = material("painted", colours.name, "ShaderNodeBsdfDiffuse", "Surface")
mesh.data.materials.clear()
mesh.data.materials.append(painted)
smoke, volume = material("smoke", None, "ShaderNodeVolumePrincipled", "Volume")
volume.inputs["Density"].default_value = 12
fog.data.materials.append(smoke)

scene = bpy.context.scene
sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
sun.data.energy = 3
sun.rotation_euler = (0.7, 0.3, 0.5)
scene.collection.objects.link(sun)
camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
camera.location = (0, -6.2, 1.8)
camera.rotation_euler = (Vector() - camera.location).to_track_quat("-Z", "Y").to_euler()
scene.collection.objects.link(camera)
scene.camera = camera
scene.world = bpy.data.worlds.new("sky")
scene.world.color = (0.7, 0.72, 0.75)
scene.render.engine = "CYCLES"
scene.cycles.samples = 24
scene.cycles.use_denoising = False
scene.cycles.device = "CPU"
scene.render.resolution_x, scene.render.resolution_y = 320, 240
scene.render.resolution_percentage = 100
scene.render.filepath = f"{folder}/interop_blender.png"
bpy.ops.render.render(write_still=True)
print(f"interop: mesh of {len(mesh.data.polygons)} triangles, colours within {255 * worst:.1f}/255, fog {size:.3f} wide")
