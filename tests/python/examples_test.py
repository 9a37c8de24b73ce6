"""The scripts in examples/ run with what Debian packages."""
import os
import subprocess
import sys

import numpy as np
import pytest
from conftest import columns_of, sphere, write_ply


@pytest.fixture
def example(source):
    def run(name, *words):
        done = subprocess.run([sys.executable, source / "examples" / name, *map(str, words)], capture_output=True,
                              text=True, env=os.environ)
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


def test_open3d(tmp_path, example):
    pytest.importorskip("open3d")
    points, normals = sphere(20_000)
    colour = (127.5 * (points + 1)).astype(np.uint8)
    write_ply(tmp_path / "cloud.ply", columns_of(points, normals, red=colour[:, 0], green=colour[:, 1], blue=colour[:, 2]))
    said = example("open3d_mesh.py", tmp_path / "cloud.ply", tmp_path / "mesh.ply")
    assert "edge-manifold: True" in said
    assert abs(float(said.split("area:")[1]) - 4 * np.pi) < 0.05
    assert (tmp_path / "mesh.ply").stat().st_size > 0


def test_las_tiles(tmp_path, program, example):
    rng = np.random.default_rng(3)
    ground = np.column_stack([1000 * rng.random((40_000, 2)), np.zeros(40_000)])
    ground[:, 2] = 20 * np.sin(ground[:, 0] / 100) + 500
    tiles = tmp_path / "tiles"
    tiles.mkdir()
    for name, part in (("west", ground[:, 0] < 500), ("east", ground[:, 0] >= 500)):
        write_ply(tmp_path / "tile.ply", {axis: ground[part, i] for i, axis in enumerate("xyz")})
        program("convert", tmp_path / "tile.ply", "-o", tiles / f"{name}.laz")
    said = example("las_tiles.py", tiles, tmp_path / "ground.ply")
    assert said.startswith("40000 points") and "triangles" in said
    assert (tmp_path / "ground.ply").stat().st_size > 100_000


def test_volume(tmp_path, program, example):
    pytest.importorskip("pyopenvdb")
    program("scatter", "--shape", "sphere", "--count", "20000", "-o", tmp_path / "ball.ply")
    program("surface", tmp_path / "ball.ply", "-o", tmp_path / "mesh.ply")
    said = example("volume_numpy.py", tmp_path / "mesh.ply", tmp_path / "mesh.vdb")
    assert "the same in pyopenvdb: True" in said
