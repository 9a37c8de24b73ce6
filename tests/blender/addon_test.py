"""In Blender: installs the add-on, imports a scan, checks every object against the program's own files, renders.
Usage: blender -b --factory-startup -P addon_test.py -- ZIP SCAN FOLDER [PICTURE]"""

import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

ZIP, SCAN, FOLDER, PICTURE = sys.argv[sys.argv.index("--") + 1 :]
SHIFT = (500000.25, 4000000.5, 30.0)


def lamina(*words):
    return subprocess.run(["lamina", *words], check=True, capture_output=True, text=True).stdout


def array(items, attribute, width, kind=np.float32):
    values = np.empty(len(items) * width, dtype=kind)
    items.foreach_get(attribute, values)
    return values.reshape(-1, width)


bpy.ops.object.select_all(action="SELECT")
bpy.ops.object.delete()
bpy.ops.preferences.addon_install(filepath=ZIP)
bpy.ops.preferences.addon_enable(module="lamina_surface")
addon = bpy.context.preferences.addons["lamina_surface"]
assert Path(sys.modules["lamina_surface"].__file__).is_relative_to(FOLDER), "not the one from the zip"
version = ".".join(map(str, sys.modules["lamina_surface"].bl_info["version"]))
assert lamina("--version").split()[1] == version, version
from lamina_surface import ply  # noqa: E402: installed just now

scene, settings = bpy.context.scene, bpy.context.scene.lamina
settings.volume_folder = FOLDER

# The scan as a coloured mesh, and a fog beside it.
settings.volume = "FOG"
assert bpy.ops.import_mesh.lamina(filepath=SCAN) == {"FINISHED"}
made = bpy.context.object
lamina("surface", SCAN, "-o", f"{FOLDER}/typed.ply", "--local", "--vdb", f"{FOLDER}/typed.vdb")
typed = ply.read_mesh(f"{FOLDER}/typed.ply")
data = made.data
assert np.array_equal(array(data.vertices, "co", 3), typed.vertices)
assert np.array_equal(array(data.loops, "vertex_index", 1, np.int32).reshape(-1, 3), typed.triangles)
assert not data.validate()
assert tuple(made.location) == (0, 0, 1) and tuple(made["lamina_offset"]) == (0, 0, 0)
data.calc_normals_split()
normals = array(data.loops, "normal", 3)
worst = np.degrees(np.arccos(np.clip(np.einsum("ij,ij->i", normals, typed.normals[typed.triangles.ravel()]), -1, 1)).max())
assert worst < 0.5, f"normals differ by up to {worst} degrees"
colours = data.color_attributes.active_color
assert np.abs(array(colours.data, "color_srgb", 4) - typed.colours).max() < 0.003
assert data.materials[0].node_tree.nodes["Color Attribute"].layer_name == colours.name
fog = scene.objects[made.name + " volume"]
assert fog.data.grids.load() and [grid.name for grid in fog.data.grids] == ["density"]
assert fog.location == made.location
assert np.allclose(fog.dimensions, made.dimensions, atol=0.1), (fog.dimensions, made.dimensions)

# Far from the origin: the scene is recentred, neighbours meet, positions can be told.
settings.volume = "LEVEL_SET"
for name, shift in (("far", SHIFT), ("next", (SHIFT[0] + 2, *SHIFT[1:]))):
    lamina("transform", SCAN, "--translate", ",".join(map(str, shift)), "--precision", "double", "-o", f"{FOLDER}/{name}.ply")
    settings.inputs.add().path = f"{FOLDER}/{name}.ply"
    assert bpy.ops.lamina.reconstruct() == {"FINISHED"}
    settings.inputs.clear()
far, following = scene.objects["far"], scene.objects["next"]
assert far.location.length < 2 and tuple(far["lamina_offset"]) == tuple(scene["lamina_offset"])
assert tuple(following["lamina_offset"]) == tuple(scene["lamina_offset"])
for one, shift in ((far, SHIFT), (following, (SHIFT[0] + 2, *SHIFT[1:]))):
    there = array(one.data.vertices, "co", 3).astype(float) + np.array(one.location) + np.array(one["lamina_offset"]) - shift
    here = typed.vertices + np.array((0, 0, 1))
    assert np.abs(np.percentile(there, (1, 50, 99), axis=0) - np.percentile(here, (1, 50, 99), axis=0)).max() < 0.02
level_set = scene.objects["next volume"]
assert level_set.data.grids.load() and "surface" in [grid.name for grid in level_set.data.grids]

# Preset, smoothness, fewer triangles, no colours; the program of the preferences.
addon.preferences.program = str(Path(FOLDER, "bin/lamina"))
settings.volume, settings.preset, settings.automatic, settings.blend = "NONE", "handheld", False, 3
settings.keep, settings.colours = 0.25, False
assert bpy.ops.import_mesh.lamina(filepath=SCAN) == {"FINISHED"}
plain = bpy.context.object
assert 1000 < len(plain.data.polygons) < len(data.polygons) / 4
assert not plain.data.color_attributes and not plain.data.materials


def complaint(operator, **arguments):
    try:
        operator(**arguments)
    except RuntimeError as error:
        return str(error)
    return ""


assert "no points" in complaint(bpy.ops.import_mesh.lamina, filepath=str(Path(FOLDER, "typed.vdb")))
assert "name the points first" in complaint(bpy.ops.lamina.reconstruct)
addon.preferences.program = FOLDER
assert "is no program" in complaint(bpy.ops.import_mesh.lamina, filepath=SCAN)

# A picture: mesh and fog side by side, by Cycles, which needs no display.
for one in (far, following, plain, scene.objects["far volume"], level_set):
    bpy.data.objects.remove(one)
fog.location.x += 1.5
smoke = bpy.data.materials.new("smoke")
smoke.use_nodes = True
smoke.node_tree.nodes.clear()
volume, output = (smoke.node_tree.nodes.new(f"ShaderNode{kind}") for kind in ("VolumePrincipled", "OutputMaterial"))
smoke.node_tree.links.new(volume.outputs[0], output.inputs["Volume"])
volume.inputs["Density"].default_value = 30
fog.data.materials.append(smoke)
sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
sun.data.energy, sun.rotation_euler = 3.5, (0.8, 0.2, 0.5)
camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
target = (made.location + fog.location) / 2
camera.location = target + Vector((0, -5.2, 1.6))
camera.rotation_euler = (target - camera.location).to_track_quat("-Z", "Y").to_euler()
for one in (sun, camera):
    scene.collection.objects.link(one)
scene.camera = camera
scene.world = bpy.data.worlds.new("sky")
scene.world.color = (0.7, 0.72, 0.75)
scene.render.engine = "CYCLES"
scene.cycles.device, scene.cycles.use_denoising = "CPU", False
scene.cycles.samples = 48 if PICTURE else 4
scene.render.resolution_x, scene.render.resolution_y = (640, 420) if PICTURE else (96, 64)
scene.render.resolution_percentage = 100
scene.render.filepath = PICTURE or f"{FOLDER}/picture.png"
bpy.ops.render.render(write_still=True)
picture = bpy.data.images.load(scene.render.filepath)
pixels = np.array(picture.pixels[:]).reshape(picture.size[1], picture.size[0], 4)[..., :3]
left, right = np.array_split(pixels, 2, axis=1)
colourful = np.ptp(left, axis=2).max()
assert colourful > 0.2, f"the mesh shows no colours: {colourful}"
assert right.std() > 0.02, "there is no fog"
print(f"addon: {len(data.polygons)} triangles with colours, normals within {worst:.2f} degrees, volumes, picture: ok")
