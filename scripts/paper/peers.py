"""Other programs on the same samples, all Debian 12 packages: meshlab (with xvfb), python3-open3d, libcgal-dev, pcl-tools.

Each peer is a function (samples, mesh, noisy, resolution) -> cost, or RunFailed: `resolution` is that of a grid, in cells
along the diagonal, which gives about as many triangles as ours have. Octrees get the depths next to that, and CGAL, which
refines, triangles of a size near.
"""
import math
import os
import shutil
import subprocess
import sys

from paper import runs

HERE = os.path.dirname(os.path.abspath(__file__))
CGAL_RADIUS = "1.5"  # sample spacings
WRAP_ALPHA, WRAP_OFFSET = "5", "0.5"  # sample spacings
TRIM = 2  # levels of the octree, from the median density
# Triangles of a grid in its squares of area, counted with MeshLab's APSS.
GRID_TRIANGLES = 3.3


def available(folder, program, limit):
    """Name and function of every peer that is installed, each of whose runs may take `limit` seconds; names and packages
    of the others."""
    found, missing = {}, []

    def add(name, package, there, function):
        if there:
            found[name] = function
        else:
            missing.append(f"{name} ({package})")

    meshlab = bool(shutil.which("meshlabserver") and shutil.which("xvfb-run"))
    for name, filter_name in (("MeshLab APSS", "Marching Cubes (APSS)"), ("MeshLab RIMLS", "Marching Cubes (RIMLS)")):
        add(name, "meshlab, xvfb, xauth", meshlab, _moving_least_squares(filter_name, folder, limit))
    for depth in (9, 10):
        add(f"MeshLab screened Poisson, depth {depth}", "meshlab, xvfb, xauth", meshlab, _meshlab_poisson(depth, folder, limit))
    open3d = subprocess.run([sys.executable, "-c", "import open3d"], capture_output=True).returncode == 0
    for depth in (9, 10):
        add(f"Open3D Poisson, depth {depth}", "python3-open3d", open3d, _open3d(depth, limit))
    add("PCL Poisson, depth 9", "pcl-tools", bool(shutil.which("pcl_poisson_reconstruction")), _pcl(9, folder, program, limit))
    cgal = _build_cgal("cgal_poisson", folder)
    add("CGAL Poisson", "libcgal-dev, g++", cgal is not None, lambda samples, mesh, noisy, resolution: runs.run(
        [cgal, samples, mesh, CGAL_RADIUS], limit=limit))
    return found, missing


def available_for_scans(folder, program, limit, depths):
    """As available(), of those that are run on scans; Open3D's Poisson at the depths given."""
    found, missing = available(folder, program, limit)
    open3d = any(name.startswith("Open3D") for name in found)
    found = {f"Open3D Poisson, depth {depth}, trimmed": _open3d(depth, limit, TRIM) for depth in depths if open3d} | {
        name: peer for name, peer in found.items() if name.startswith("MeshLab") and "10" not in name}
    wrap = _build_cgal("cgal_alpha_wrap", folder)
    if wrap:
        found["CGAL alpha wrap"] = lambda samples, mesh, noisy, resolution: runs.run(
            [wrap, samples, mesh, WRAP_ALPHA, WRAP_OFFSET], limit=limit)
    else:
        missing.append("CGAL alpha wrap (libcgal-dev, g++)")
    return found, missing


def grid_resolution(triangles, truth):
    """Cells along the diagonal of a grid that gives so many triangles; `truth`: what lamina measure tells of the model."""
    diagonal = math.dist(truth["low"], truth["high"])
    return round(diagonal * math.sqrt(triangles / (GRID_TRIANGLES * truth["area"])))


def _filter_script(path, name, parameters):
    lines = "".join(f'  <Param type="Rich{kind}" value="{value}" name="{key}"/>\n' for key, (kind, value) in
                    parameters.items())
    with open(path, "w") as f:
        f.write(f'<!DOCTYPE FilterScript>\n<FilterScript>\n <filter name="{name}">\n{lines} </filter>\n</FilterScript>\n')


def _meshlab(samples, mesh, script, limit):
    return runs.run(["xvfb-run", "-a", "meshlabserver", "-i", samples, "-o", mesh, "-s", script], limit=limit)


def _moving_least_squares(name, folder, limit):
    script = os.path.join(folder, "filter.mlx")

    def peer(samples, mesh, noisy, resolution):
        # With the default support, 2, cells of this size are mostly empty. Twice as wide again on noise, as this
        # program's own settings for it.
        parameters = {"FilterScale": ("Float", 8 if noisy else 4), "ProjectionAccuracy": ("Float", 0.0001),
                      "MaxProjectionIters": ("Int", 15), "Resolution": ("Int", resolution)}
        if "RIMLS" in name:
            parameters |= {"SigmaN": ("Float", 0.75), "MaxRefittingIters": ("Int", 3)}
        else:
            parameters |= {"SphericalParameter": ("Float", 1), "AccurateNormal": ("Bool", "true")}
        _filter_script(script, name, parameters)
        return _meshlab(samples, mesh, script, limit)

    return peer


def _meshlab_poisson(depth, folder, limit):
    script = os.path.join(folder, "filter.mlx")

    def peer(samples, mesh, noisy, resolution):
        _filter_script(script, "Surface Reconstruction: Screened Poisson", {
            "visibleLayer": ("Bool", "false"), "depth": ("Int", depth), "fullDepth": ("Int", 5), "cgDepth": ("Int", 0),
            "scale": ("Float", 1.1), "samplesPerNode": ("Float", 3 if noisy else 1.5), "pointWeight": ("Float", 4),
            "iters": ("Int", 8), "confidence": ("Bool", "false"), "preClean": ("Bool", "false")})
        return _meshlab(samples, mesh, script, limit)

    return peer


def meshlab_decimation(folder, limit):
    """Its quadric edge collapse with optimal placement: a function (mesh, fewer, triangles) -> cost."""
    script = os.path.join(folder, "filter.mlx")

    def decimate(mesh, fewer, triangles):
        _filter_script(script, "Simplification: Quadric Edge Collapse Decimation", {
            "TargetFaceNum": ("Int", triangles), "TargetPerc": ("Float", 0), "QualityThr": ("Float", 0.3),
            "PreserveBoundary": ("Bool", "false"), "BoundaryWeight": ("Float", 1), "PreserveNormal": ("Bool", "false"),
            "PreserveTopology": ("Bool", "false"), "OptimalPlacement": ("Bool", "true"), "PlanarQuadric": ("Bool", "false"),
            "PlanarWeight": ("Float", 0.001), "QualityWeight": ("Bool", "false"), "AutoClean": ("Bool", "true"),
            "Selected": ("Bool", "false")})
        return _meshlab(mesh, fewer, script, limit)

    return decimate


def _open3d(depth, limit, *trim):
    def peer(samples, mesh, noisy, resolution):
        return runs.run([sys.executable, os.path.join(HERE, "open3d_poisson.py"), samples, mesh, *map(str, (depth, *trim))],
                        limit=limit)

    return peer


def _pcl(depth, folder, program, limit):
    def peer(samples, mesh, noisy, resolution):
        points, vtk = os.path.join(folder, "points.pcd"), os.path.join(folder, "pcl.vtk")
        subprocess.run([program, "convert", samples, "-o", points, "--precision", "float", "--quiet"], check=True)
        cost = runs.run(["pcl_poisson_reconstruction", points, vtk, "-depth", str(depth), "-solver_divide", "8",
                         "-iso_divide", "8"], limit=limit)
        subprocess.run(["pcl_vtk2ply", vtk, mesh], check=True, capture_output=True)
        return cost

    return peer


def _build_cgal(name, folder):
    """Compiles the few lines around CGAL's function; None without CGAL."""
    binary = os.path.join(folder, name)
    source = os.path.join(HERE, name + ".cpp")
    if os.path.exists(binary) and os.path.getmtime(binary) > os.path.getmtime(source):
        return binary
    command = ["g++", "-O3", "-DNDEBUG", "-DCGAL_EIGEN3_ENABLED", "-I/usr/include/eigen3", "-std=c++17", source, "-o", binary,
               "-lgmp", "-lmpfr"]
    return binary if subprocess.run(command, capture_output=True).returncode == 0 else None
