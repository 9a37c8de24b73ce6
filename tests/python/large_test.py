"""Ten million points, by hand: LAMINA_LARGE=1. Python adds at most 5 % of time, and no second copy of the cloud."""
import os
import subprocess
import sys
import time

import numpy as np
import pytest
from conftest import columns_of, sphere, write_ply

pytestmark = pytest.mark.skipif(not os.environ.get("LAMINA_LARGE"), reason="LAMINA_LARGE is not set")

RUN = """
import sys, time, numpy as np, lamina
points, normals = np.load(sys.argv[1]), np.load(sys.argv[2])
begin = time.perf_counter()
peak = lambda: int(next(line for line in open("/proc/self/status") if line.startswith("VmHWM")).split()[1]) * 1024
before = peak()
stats = lamina.surface_to_file(points, sys.argv[3], normals)
print(time.perf_counter() - begin, peak() - before, points.nbytes + normals.nbytes)
begin = time.perf_counter()
mesh = lamina.surface(points, normals)
print(time.perf_counter() - begin, peak() - before, mesh.vertices.nbytes + mesh.normals.nbytes + mesh.faces.nbytes)
mesh.save(sys.argv[4])
"""


def test_ten_million_points(tmp_path, program):
    count = int(os.environ.get("LAMINA_LARGE_COUNT", 10_000_000))
    points, normals = (array.astype(np.float32) for array in sphere(count))
    np.save(tmp_path / "points.npy", points)
    np.save(tmp_path / "normals.npy", normals)
    write_ply(tmp_path / "cloud.ply", columns_of(points, normals))
    times = {"program": [], "python": [], "memory": []}
    for _ in range(2):
        begin = time.perf_counter()
        program("surface", tmp_path / "cloud.ply", "-o", tmp_path / "program.ply")
        times["program"].append(time.perf_counter() - begin)
        said = subprocess.run([sys.executable, "-c", RUN, tmp_path / "points.npy", tmp_path / "normals.npy",
                               tmp_path / "file.ply", tmp_path / "saved.ply"], capture_output=True, text=True, check=True)
        lines = [[float(word) for word in line.split()] for line in said.stdout.splitlines()]
        times["python"].append(lines[0][0])
        times["memory"].append(lines[1][0])
    print({name: [round(value, 2) for value in values] for name, values in times.items()})
    print("bytes of the cloud", lines[0][2], "on top of them, into a file", lines[0][1], "as a mesh", lines[1][1],
          "whose arrays are", lines[1][2])
    expected = (tmp_path / "program.ply").read_bytes()
    assert (tmp_path / "file.ply").read_bytes() == expected
    assert (tmp_path / "saved.ply").read_bytes() == expected
    assert lines[0][1] < lines[0][2] + 300e6
