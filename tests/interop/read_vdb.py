"""Compares level sets of spheres, read by OpenVDB's own Python module, with the truth. Usage: read_vdb.py FOLDER"""
import math
import sys

import pyopenvdb as vdb

folder = sys.argv[1]


def check(path, centre, radius):
    """Distances, signs and the transform of a sphere's level set."""
    grid = vdb.read(path, "surface")
    assert grid.gridClass == vdb.GridClass.LEVEL_SET, grid.gridClass
    voxel = grid.transform.voxelSize()[0]
    origin = grid.transform.indexToWorld((0, 0, 0))
    along = grid.transform.indexToWorld((1, 0, 0))
    edge = math.dist(origin, along)
    assert abs(edge - voxel) < 1e-5 * voxel, (edge, voxel)
    worst = 0.0
    count = 0
    low = [math.inf] * 3
    high = [-math.inf] * 3
    for item in grid.citerOnValues():
        for index in (item.min,) if item.min == item.max else (item.min, item.max):
            world = grid.transform.indexToWorld(index)
            truth = math.dist(world, centre) - radius
            if abs(item.value) > voxel:
                continue
            worst = max(worst, abs(truth - item.value))
            low = [min(a, b) for a, b in zip(low, world)]
            high = [max(a, b) for a, b in zip(high, world)]
            count += 1
    assert count > 1000, count
    assert worst < 0.15 * voxel, (worst, voxel)
    for axis in range(3):
        middle = 0.5 * (low[axis] + high[axis])
        assert abs(middle - centre[axis]) < voxel, (axis, middle)
    print(f"interop: {path.rsplit('/', 1)[-1]}: {count} voxels within a voxel of the surface, "
          f"distances differ from the truth by {worst / voxel:.3f} voxels at most")


check(f"{folder}/sphere.vdb", (0, 0, 0), 1)
check(f"{folder}/georeferenced.vdb", (500000, 4000000, 30), 2)

names = {grid.name for grid in vdb.readAllGridMetadata(f"{folder}/sphere.vdb")}
assert {"surface", "Cd", "N", "weight"} <= names, names
distances = vdb.read(f"{folder}/sphere.vdb", "surface")
colours = vdb.read(f"{folder}/sphere.vdb", "Cd").getConstAccessor()
normals = vdb.read(f"{folder}/sphere.vdb", "N").getConstAccessor()
worst_colour = worst_angle = 0.0
for item in distances.citerOnValues():
    if item.min != item.max or abs(item.value) > 0.5 * distances.transform.voxelSize()[0]:
        continue
    world = distances.transform.indexToWorld(item.min)
    length = math.dist(world, (0, 0, 0))
    outward = [c / length for c in world]
    colour, normal = colours.getValue(item.min), normals.getValue(item.min)
    worst_colour = max(worst_colour, max(abs(c - 0.5 * (1 + o)) for c, o in zip(colour, outward)))
    cosine = sum(n * o for n, o in zip(normal, outward)) / math.hypot(*normal)
    worst_angle = max(worst_angle, math.degrees(math.acos(min(1.0, cosine))))
assert worst_colour < 0.03, worst_colour
assert worst_angle < 3, worst_angle
print(f"interop: Cd within {255 * worst_colour:.1f}/255, N within {worst_angle:.2f} degrees")
