"""Binary PLY meshes as NumPy arrays, a million triangles in a fraction of a second. Knows nothing of Blender."""

from dataclasses import dataclass

import numpy as np

TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip
LONGEST_HEADER = 1 << 20


class PlyError(Exception):
    """What is wrong with a file, in a line for the user."""


@dataclass
class Mesh:
    vertices: np.ndarray  # (n, 3) float32
    triangles: np.ndarray  # (m, 3) int32
    normals: np.ndarray = None  # (n, 3) float32
    colours: np.ndarray = None  # (n, 4) float32, 0 to 1
    bytes_per_colour: int = 1


def _read_header(file, path):
    """[(element, count, [(name, type or (count type, item type))])], and the byte order."""
    order, elements = None, []
    if file.readline(8).rstrip() != b"ply":
        raise PlyError(f"{path}: is not a PLY file")
    while file.tell() < LONGEST_HEADER:
        words = file.readline(4096).decode("ascii", "replace").split()
        if not words:
            break
        if words[0] == "end_header":
            if order is None:
                raise PlyError(f"{path}: is not binary")
            return order, elements
        if words[0] == "format":
            order = {"binary_little_endian": "<", "binary_big_endian": ">"}.get(words[1])
        elif words[0] == "element":
            elements.append((words[1], int(words[2]), []))
        elif words[0] == "property" and words[1] == "list":
            elements[-1][2].append((words[4], (TYPES[words[2]], TYPES[words[3]])))
        elif words[0] == "property":
            elements[-1][2].append((words[2], TYPES[words[1]]))
    raise PlyError(f"{path}: its header does not end")


def _read_rows(file, path, order, element):
    """An element's rows; lists are taken to have three items each, which is checked afterwards."""
    name, count, properties = element
    fields = []
    for prop, kind in properties:
        if isinstance(kind, tuple):
            fields += [(prop + "#", order + kind[0]), (prop, order + kind[1], (3,))]
        else:
            fields.append((prop, order + kind))
    rows = np.fromfile(file, dtype=np.dtype(fields), count=count)
    if len(rows) != count:
        raise PlyError(f"{path}: ends after {len(rows)} of {count} rows of '{name}'")
    for prop, kind in properties:
        if isinstance(kind, tuple) and count and not np.all(rows[prop + "#"] == 3):
            raise PlyError(f"{path}: not every face is a triangle")
    return rows


def _columns(rows, names, kind):
    if not all(name in rows.dtype.names for name in names):
        return None
    together = np.empty((len(rows), len(names)), dtype=kind)
    for k, name in enumerate(names):
        together[:, k] = rows[name]
    return together


def read_mesh(path):
    """The triangle mesh in the file, with normals and colours where it has them."""
    with open(path, "rb") as file:
        order, elements = _read_header(file, path)
        rows = {element[0]: _read_rows(file, path, order, element) for element in elements}
    if "vertex" not in rows or "face" not in rows:
        raise PlyError(f"{path}: has no mesh")
    vertex, face = rows["vertex"], rows["face"]
    index = next((name for name in ("vertex_indices", "vertex_index") if name in face.dtype.names), None)
    vertices = _columns(vertex, "xyz", np.float32)
    if vertices is None or index is None:
        raise PlyError(f"{path}: has no mesh")
    triangles = np.ascontiguousarray(face[index], dtype=np.int32)
    if len(triangles) and not 0 <= triangles.min() <= triangles.max() < len(vertices):
        raise PlyError(f"{path}: a face names a vertex that is not there")
    mesh = Mesh(vertices, triangles, _columns(vertex, ("nx", "ny", "nz"), np.float32))
    colours = _columns(vertex, ("red", "green", "blue"), np.float32)
    if colours is not None:
        kind = vertex.dtype["red"]
        if kind.kind == "u":
            mesh.bytes_per_colour = kind.itemsize
            colours /= np.iinfo(kind).max
        mesh.colours = np.ones((len(vertices), 4), dtype=np.float32)
        mesh.colours[:, :3] = colours
    return mesh
