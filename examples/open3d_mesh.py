"""From an Open3D cloud to a mesh and back.

Usage: open3d_mesh.py CLOUD.ply MESH.ply
"""
import sys

import lamina
import numpy as np
import open3d as o3d

cloud = o3d.io.read_point_cloud(sys.argv[1])
points = np.asarray(cloud.points)  # Open3D's own memory, which lamina reads where it lies
normals = np.asarray(cloud.normals) if cloud.has_normals() else None
attributes = {}
if cloud.has_colors():
    attributes["colors"] = np.round(255 * np.asarray(cloud.colors)).astype(np.uint8)

mesh = lamina.surface(points, normals, attributes=attributes)
print(mesh)

shown = o3d.geometry.TriangleMesh(
    o3d.utility.Vector3dVector(mesh.vertices), o3d.utility.Vector3iVector(mesh.faces.astype(np.int32))
)
shown.vertex_normals = o3d.utility.Vector3dVector(mesh.normals.astype(np.float64))
if mesh.colors is not None:
    shown.vertex_colors = o3d.utility.Vector3dVector(mesh.colors / 255)
print("edge-manifold:", shown.is_edge_manifold(allow_boundary_edges=False))

back = lamina.Mesh(np.asarray(shown.vertices), np.asarray(shown.triangles), np.asarray(shown.vertex_normals))
print("area:", round(lamina.measure(back)["area"], 4))
o3d.io.write_triangle_mesh(sys.argv[2], shown)
