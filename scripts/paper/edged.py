"""Models with sharp edges, for scripts/paper-tables: two of the reconstruction benchmark's (Berger et al. 2013), and a gear
and a turned part made here, whose faces are few and known exactly."""
import math
import os

from paper import models

NAMES = ("anchor", "lordquas", "gear", "lathe")
CHOICES = {"lamina": [], "lamina --features no": ["--features", "no"]}
PEER = "MeshLab screened Poisson, depth 10"


def truth(name, folder, data):
    """The file of a model's true mesh, made on first use; None where it cannot be had."""
    if name in ("anchor", "lordquas"):
        path = os.path.join(data, "truth", name + ".off")
        return path if os.path.exists(path) else None
    path = os.path.join(folder, f"truth_{name}.off")
    if not os.path.exists(path):
        _write_off(path, *(_gear() if name == "gear" else _lathe()))
    return path


def samples(name, true_mesh, count, program, folder):
    return models.samples(name, true_mesh, count, False, program, folder)


def _gear():
    """Twelve teeth and a slanted top: edges at many angles, corners of three faces."""
    profile = [(r * math.cos(a), r * math.sin(a)) for k in range(12) for a, r in (
        (math.pi * k / 6 + turn, r) for turn, r in ((-0.17, 0.8), (-0.10, 1.05), (0.10, 1.05), (0.17, 0.8)))]
    n = len(profile)
    vertices = [(x, y, -0.3) for x, y in profile] + [(x, y, 0.3 + 0.15 * x) for x, y in profile]
    vertices += [(0, 0, -0.3), (0, 0, 0.3)]
    faces = []
    for i in range(n):
        j = (i + 1) % n
        faces += [(i, j, n + j), (i, n + j, n + i), (2 * n, j, i), (2 * n + 1, n + i, n + j)]
    return vertices, faces


def _lathe(around=360):
    """Steps, a cone, a groove and a dome on one axis: edges that bend."""
    profile = [(0, -1), (0.8, -1), (0.8, -0.6), (0.5, -0.5), (0.5, -0.1), (0.42, -0.06), (0.5, -0.02), (0.5, 0.2),
               (0.7, 0.35), (0.7, 0.5)]
    profile += [(0.7 * math.cos(t), 0.5 + 0.45 * math.sin(t)) for t in (math.pi / 78 * k for k in range(1, 39))] + [(0, 0.95)]
    vertices, rings = [], []
    for r, z in profile:
        first, size = len(vertices), around if r > 0 else 1
        vertices += [(r * math.cos(2 * math.pi * k / around), r * math.sin(2 * math.pi * k / around), z) for k in range(size)]
        rings.append([first + k % size for k in range(around)])
    faces = []
    for low, high in zip(rings, rings[1:]):
        for k in range(around):
            m = (k + 1) % around
            faces += [t for t in ((low[k], low[m], high[m]), (low[k], high[m], high[k])) if len(set(t)) == 3]
    return vertices, faces


def _write_off(path, vertices, faces):
    """Every face with vertices of its own, so that samples get its normal and none that is interpolated over an edge."""
    with open(path + ".part", "w") as f:
        f.write(f"OFF\n{3 * len(faces)} {len(faces)} 0\n")
        f.writelines("%.9g %.9g %.9g\n" % turned(vertices[v]) for face in faces for v in face)
        f.writelines(f"3 {3 * i} {3 * i + 1} {3 * i + 2}\n" for i in range(len(faces)))
    os.rename(path + ".part", path)


def turned(p, a=0.5, b=0.8):
    """About two axes, so that no edge follows a coordinate axis."""
    x, y, z = p
    y, z = y * math.cos(a) - z * math.sin(a), y * math.sin(a) + z * math.cos(a)
    return x * math.cos(b) + z * math.sin(b), y, z * math.cos(b) - x * math.sin(b)
