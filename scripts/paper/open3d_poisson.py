"""Screened Poisson by Open3D, on every core: open3d_poisson.py POINTS MESH DEPTH [TRIM]

TRIM: what lies where samples are as rare as so many levels of the octree above the median is cut away.
"""
import os
import sys

import numpy as np
import open3d

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
from paper import meshes, trim  # noqa: E402  (beside this script)

cloud = open3d.io.read_point_cloud(sys.argv[1])
depth = int(sys.argv[3])
mesh, density = open3d.geometry.TriangleMesh.create_from_point_cloud_poisson(cloud, depth=depth)
if len(sys.argv) > 4:
    density = np.asarray(density)
    positions, triangles = trim.trim(np.asarray(mesh.vertices), np.asarray(mesh.triangles).astype(np.int64), density,
                                     np.median(density) - float(sys.argv[4]))
    meshes.write_ply(sys.argv[2], positions, triangles)
else:
    open3d.io.write_triangle_mesh(sys.argv[2], mesh)
