"""Other programs on the same samples, all Debian 12 packages: meshlab (with xvfb), python3-open3d, libcgal-dev, pcl-tools.

Each peer is a function (samples, mesh, noisy, target) -> cost or None: `target` is the number of triangles to come close to.
What runs a grid or an octree gets the resolution that comes closest; CGAL, which refines, triangles of a size near.
"""
import math
import os
import shutil
import subprocess
import sys

from paper import runs

HERE = os.path.dirname(os.path.abspath(__file__))
CGAL_RADIUS = "1.5"  # sample spacings
CALIBRATION = 150  # grid cells along the diagonal of the first, cheap run


def available(folder, program):
    """Name, package and function of every peer that is installed; names of the others."""
    found, missing = {}, []

    def add(name, package, there, function):
        if there:
            found[name] = function
        else:
            missing.append(f"{name} ({package})")

    meshlab = bool(shutil.which("meshlabserver") and shutil.which("xvfb-run"))
    for name, filter_name in (("MeshLab APSS", "Marching Cubes (APSS)"), ("MeshLab RIMLS", "Marching Cubes (RIMLS)")):
        add(name, "meshlab, xvfb, xauth", meshlab, _moving_least_squares(filter_name, folder, program))
    for depth in (9, 10):
        add(f"MeshLab screened Poisson, depth {depth}", "meshlab, xvfb, xauth", meshlab, _meshlab_poisson(depth, folder))
    open3d = subprocess.run([sys.executable, "-c", "import open3d"], capture_output=True).returncode == 0
    for depth in (9, 10):
        add(f"Open3D Poisson, depth {depth}", "python3-open3d", open3d, _open3d(depth))
    add("PCL Poisson, depth 9", "pcl-tools", bool(shutil.which("pcl_poisson_reconstruction")), _pcl(9, folder, program))
    cgal = _build_cgal(folder)
    add("CGAL Poisson", "libcgal-dev, g++", cgal is not None, lambda samples, mesh, noisy, target: runs.run(
        [cgal, samples, mesh, CGAL_RADIUS]))
    return found, missing


def _filter_script(path, name, parameters):
    lines = "".join(f'  <Param type="Rich{kind}" value="{value}" name="{key}"/>\n' for key, (kind, value) in
                    parameters.items())
    with open(path, "w") as f:
        f.write(f'<!DOCTYPE FilterScript>\n<FilterScript>\n <filter name="{name}">\n{lines} </filter>\n</FilterScript>\n')


def _meshlab(samples, mesh, script):
    return runs.run(["xvfb-run", "-a", "meshlabserver", "-i", samples, "-o", mesh, "-s", script])


def _moving_least_squares(name, folder, program):
    script = os.path.join(folder, "filter.mlx")

    def at(resolution, samples, mesh, noisy):
        # A support twice as wide on noise, as this program's own settings for it.
        parameters = {"FilterScale": ("Float", 4 if noisy else 2), "ProjectionAccuracy": ("Float", 0.0001),
                      "MaxProjectionIters": ("Int", 15), "Resolution": ("Int", resolution)}
        if "RIMLS" in name:
            parameters |= {"SigmaN": ("Float", 0.75), "MaxRefittingIters": ("Int", 3)}
        else:
            parameters |= {"SphericalParameter": ("Float", 1), "AccurateNormal": ("Bool", "true")}
        _filter_script(script, name, parameters)
        return _meshlab(samples, mesh, script)

    def peer(samples, mesh, noisy, target):
        if at(CALIBRATION, samples, mesh, noisy) is None:
            return None
        triangles = runs.ask(program, "check", mesh)["triangles"]
        return at(round(CALIBRATION * math.sqrt(target / max(1, triangles))), samples, mesh, noisy)

    return peer


def _meshlab_poisson(depth, folder):
    script = os.path.join(folder, "filter.mlx")

    def peer(samples, mesh, noisy, target):
        _filter_script(script, "Surface Reconstruction: Screened Poisson", {
            "visibleLayer": ("Bool", "false"), "depth": ("Int", depth), "fullDepth": ("Int", 5), "cgDepth": ("Int", 0),
            "scale": ("Float", 1.1), "samplesPerNode": ("Float", 3 if noisy else 1.5), "pointWeight": ("Float", 4),
            "iters": ("Int", 8), "confidence": ("Bool", "false"), "preClean": ("Bool", "false")})
        return _meshlab(samples, mesh, script)

    return peer


def _open3d(depth):
    def peer(samples, mesh, noisy, target):
        return runs.run([sys.executable, os.path.join(HERE, "open3d_poisson.py"), samples, mesh, str(depth)])

    return peer


def _pcl(depth, folder, program):
    def peer(samples, mesh, noisy, target):
        points, vtk = os.path.join(folder, "points.pcd"), os.path.join(folder, "pcl.vtk")
        subprocess.run([program, "convert", samples, "-o", points, "--quiet"], check=True)
        cost = runs.run(["pcl_poisson_reconstruction", points, vtk, "-depth", str(depth), "-solver_divide", "8",
                         "-iso_divide", "8"])
        if cost is None:
            return None
        subprocess.run(["pcl_vtk2ply", vtk, mesh], check=True, capture_output=True)
        return cost

    return peer


def _build_cgal(folder):
    """Compiles the few lines around CGAL's function; None without CGAL."""
    binary = os.path.join(folder, "cgal_poisson")
    source = os.path.join(HERE, "cgal_poisson.cpp")
    if os.path.exists(binary) and os.path.getmtime(binary) > os.path.getmtime(source):
        return binary
    command = ["g++", "-O3", "-DNDEBUG", "-DCGAL_EIGEN3_ENABLED", "-I/usr/include/eigen3", "-std=c++17", source, "-o", binary,
               "-lgmp", "-lmpfr"]
    return binary if subprocess.run(command, capture_output=True).returncode == 0 else None
