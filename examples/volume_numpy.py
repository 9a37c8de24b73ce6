"""A mesh as a block of signed distances in NumPy, and as a level set for pyopenvdb.

Usage: volume_numpy.py MESH.ply VOLUME.vdb
"""
import sys

import lamina
import numpy as np
import pyopenvdb as vdb

mesh = lamina.Mesh.from_file(sys.argv[1])
size = np.ptp(mesh.vertices, axis=0).max()
edge = size / 64

block = lamina.voxels(mesh, voxelsize=edge, sign="inside")
inside = (block.values < 0).sum() * block.edge**3
print("block", block.values.shape, "from", np.round(block.origin, 3), "holds", round(float(inside), 4))

written = lamina.volume(mesh, sys.argv[2], voxelsize=edge, sign="inside")
grid = vdb.read(sys.argv[2], "surface")
assert grid.activeVoxelCount() == written["voxels"]
first = np.rint(np.asarray(block.origin) / block.edge).astype(int)
again = np.empty(block.values.shape, np.float32)
grid.copyToArray(again, ijk=tuple(int(i) for i in first))
print("the same in pyopenvdb:", bool((again == block.values).all()))
