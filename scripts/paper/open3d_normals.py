"""Normals by Open3D over the nearest neighbours: open3d_normals.py POINTS OUT NEIGHBOURS [TANGENT_PLANES]

Signs are those of the normals the points come with, or consistent over the graph of so many neighbours' tangent planes. A program of its own: whatever is started by one that has loaded Open3D counts its memory.
"""
import os
import sys

import open3d

source, target, neighbours = sys.argv[1], sys.argv[2], int(sys.argv[3])
cloud = open3d.io.read_point_cloud(source)
cloud.estimate_normals(open3d.geometry.KDTreeSearchParamKNN(neighbours))
if len(sys.argv) > 4:
    cloud.orient_normals_consistent_tangent_plane(int(sys.argv[4]))
open3d.io.write_point_cloud(target + ".part.ply", cloud)
os.rename(target + ".part.ply", target)
