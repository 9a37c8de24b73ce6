"""Triangle meshes as arrays: PLY files, samples by area, distances to triangles."""
import numpy as np
from scipy.spatial import cKDTree

_TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4", "double": "f8",
          "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8"}


def read_ply(path):
    """Columns of the vertices by name, and triangles (none: an empty array). Binary little-endian files, as `lamina convert`
    writes them."""
    with open(path, "rb") as file:
        elements = []
        while (line := file.readline().decode("latin1").split()) != ["end_header"]:
            if line[:1] == ["format"] and line[1] != "binary_little_endian":
                raise OSError(f"{path}: {line[1]}; binary_little_endian is read here")
            if line[:1] == ["element"]:
                elements.append((line[1], int(line[2]), []))
            if line[:1] == ["property"]:
                elements[-1][2].append(line[1:])
        vertices, triangles = {}, np.empty((0, 3), dtype=np.int64)
        for name, count, properties in elements:
            fields = []
            for words in properties:
                fields += [("count", _TYPES[words[1]]), (words[3], "<" + _TYPES[words[2]], 3)] if words[0] == "list" else [
                    (words[1], "<" + _TYPES[words[0]])]
            layout = np.dtype(fields)
            rows = np.frombuffer(file.read(count * layout.itemsize), layout)
            if name == "vertex":
                vertices = {field: rows[field] for field in layout.names}
            elif name == "face" and count:
                if (rows["count"] != 3).any():
                    raise OSError(f"{path}: a face that is no triangle")
                triangles = rows[layout.names[1]].astype(np.int64)
    return vertices, triangles


def positions_of(vertices):
    return np.stack([vertices[axis] for axis in "xyz"], 1).astype(float)


def write_ply(path, positions, triangles):
    header = (f"ply\nformat binary_little_endian 1.0\nelement vertex {len(positions)}\nproperty float x\nproperty float y\n"
              f"property float z\nelement face {len(triangles)}\nproperty list uchar int vertex_indices\nend_header\n")
    faces = np.empty(len(triangles), dtype=[("count", "u1"), ("vertices", "<i4", 3)])
    faces["count"], faces["vertices"] = 3, triangles
    with open(path, "wb") as file:
        file.write(header.encode() + positions.astype("<f4").tobytes() + faces.tobytes())


def face_normals(positions, triangles):
    """Not of unit length: twice the area."""
    a, b, c = (positions[triangles[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def sample(positions, triangles, count, seed=1):
    """Independent points at random, uniform by area, and the triangle of each."""
    sums = np.cumsum(np.linalg.norm(face_normals(positions, triangles), axis=1))
    random = np.random.default_rng(seed)
    faces = np.searchsorted(sums, random.random(count) * sums[-1], side="right").clip(0, len(triangles) - 1)
    u, v = np.sqrt(random.random(count))[:, None], random.random(count)[:, None]
    a, b, c = (positions[triangles[faces, k]] for k in range(3))
    return a + u * (1 - v) * (b - a) + u * v * (c - a), faces


class NearestTriangle:
    """Distances to a mesh: exact ones to the triangles around the nearest of points no farther apart than `spacing`."""

    CANDIDATES = 8

    def __init__(self, positions, triangles, spacing):
        self.corners = positions[triangles]
        longest = _longest_sides(self.corners)
        area = np.linalg.norm(face_normals(positions, triangles), axis=1) / 2
        counts = np.ceil(np.maximum(longest / spacing, 2 * area / spacing ** 2)).astype(np.int64).clip(1, 4_000_000)
        self.face = np.repeat(np.arange(len(triangles)), counts)
        random = np.random.default_rng(1)
        u, v = np.sqrt(random.random(len(self.face)))[:, None], random.random(len(self.face))[:, None]
        one = counts[self.face] == 1
        u[one], v[one] = 2 / 3, 0.5  # the centre
        a, b, c = (self.corners[self.face, k] for k in range(3))
        self.tree = cKDTree(a + u * (1 - v) * (b - a) + u * v * (c - a))

    def find(self, points):
        """Distance and triangle."""
        found = self.tree.query(points, min(self.CANDIDATES, len(self.face)))[1].reshape(len(points), -1)
        best, face = np.full(len(points), np.inf), np.zeros(len(points), dtype=np.int64)
        for column in range(found.shape[1]):
            candidate = self.face[found[:, column]]
            distance = _distance(points, self.corners[candidate])
            nearer = distance < best
            best[nearer], face[nearer] = distance[nearer], candidate[nearer]
        return best, face


def _longest_sides(corners):
    return np.sqrt(np.max([((corners[:, k] - corners[:, (k + 1) % 3]) ** 2).sum(1) for k in range(3)], axis=0))


def _distance(points, corners):
    """Of points to one triangle each: to its plane where they lie above it, else to its sides."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    normal = np.cross(b - a, c - a)
    square = (normal ** 2).sum(1)
    best = np.full(len(points), np.inf)
    above = square > 0
    for start, end in ((a, b), (b, c), (c, a)):
        side = end - start
        length = (side ** 2).sum(1)
        share = ((points - start) * side).sum(1) / np.where(length > 0, length, 1)
        best = np.minimum(best, np.linalg.norm(points - start - share.clip(0, 1)[:, None] * side, axis=1))
        above &= (np.cross(side, points - start) * normal).sum(1) >= 0
    height = np.abs(((points - a) * normal).sum(1)) / np.sqrt(np.where(square > 0, square, 1))
    return np.where(above, height, best)
