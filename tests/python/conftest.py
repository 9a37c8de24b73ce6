"""What the tests share: the program, clouds of known shape, and PLY files read and written by NumPy alone."""
import os
import pathlib
import subprocess

import numpy as np
import pytest

TYPES = {"float": "<f4", "double": "<f8", "uchar": "u1", "int": "<i4", "ushort": "<u2"}
NAMES = {np.dtype(code): name for name, code in TYPES.items()}


@pytest.fixture(scope="session")
def source():
    return pathlib.Path(os.environ["LAMINA_SOURCE"])


@pytest.fixture(scope="session")
def program():
    """Runs the program; returns what it wrote to standard output."""

    def run(*words, code=0):
        done = subprocess.run([os.environ["LAMINA_PROGRAM"], *map(str, words)], capture_output=True, text=True)
        assert done.returncode == code, done.stderr
        return done.stdout if code == 0 else done.stderr

    return run


def write_ply(path, columns):
    """A binary PLY of vertices; columns: name -> array."""
    rows = np.empty(len(next(iter(columns.values()))), [(name, values.dtype) for name, values in columns.items()])
    for name, values in columns.items():
        rows[name] = values
    head = [f"property {NAMES[values.dtype]} {name}" for name, values in columns.items()]
    text = "\n".join(["ply", "format binary_little_endian 1.0", f"element vertex {len(rows)}", *head, "end_header\n"])
    path.write_bytes(text.encode() + rows.tobytes())


def read_ply(path):
    """The vertices of a binary PLY: name -> array."""
    data = path.read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    lines = data[:end].decode().splitlines()
    count = next(int(line.split()[2]) for line in lines if line.startswith("element vertex"))
    fields = []
    for line in lines:
        if line.startswith("property") and "list" not in line:
            _, kind, name = line.split()
            fields.append((name, TYPES[kind]))
    rows = np.frombuffer(data, np.dtype(fields), count, end)
    return {name: rows[name] for name in rows.dtype.names}


def sphere(count, radius=1.0, seed=7):
    """Points and normals, evenly spread."""
    directions = np.random.default_rng(seed).normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    return radius * directions, directions


@pytest.fixture(scope="session")
def ball():
    """20 000 points of the unit sphere, float32, and their normals."""
    points, normals = sphere(20_000)
    return points.astype(np.float32), normals.astype(np.float32)


def columns_of(points, normals, **attributes):
    named = {name: points[:, i] for i, name in enumerate("xyz")}
    named.update({"n" + name: normals[:, i] for i, name in enumerate("xyz")})
    named.update(attributes)
    return named


@pytest.fixture
def address():
    return lambda array: array.__array_interface__["data"][0]
