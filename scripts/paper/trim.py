"""Cuts a mesh along a level of a value at its vertices, as Kazhdan's SurfaceTrimmer does with the density of samples."""
import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

SMOOTHINGS = 5          # of the values along edges, before the cut
SMALLEST_PART = 0.001   # of the area; smaller parts that the cut leaves go


def trim(positions, triangles, values, level):
    """Positions and triangles of what lies above the level."""
    values = _smoothed(triangles, values)
    below = (values < level)[triangles].sum(1)
    kept = triangles[below == 0]
    lone_above, lone_below = triangles[below == 2], triangles[below == 1]
    cuts = _Cuts(len(positions))
    parts = [kept]
    # Turned so that the vertex that lies alone on its side comes first.
    a, b, c = _first(lone_above, (values >= level)[lone_above])
    parts.append(np.stack([a, cuts.number(a, b), cuts.number(a, c)], 1))
    a, b, c = _first(lone_below, (values < level)[lone_below])
    ab, ac = cuts.number(a, b), cuts.number(a, c)
    parts += [np.stack([ab, b, c], 1), np.stack([ab, c, ac], 1)]
    low, high = cuts.ends()
    share = ((level - values[low]) / np.where(values[high] == values[low], 1, values[high] - values[low]))[:, None]
    positions = np.vstack([positions, positions[low] + share * (positions[high] - positions[low])])
    return _without_small_parts(positions, np.vstack(parts))


def _smoothed(triangles, values):
    edges = np.vstack([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    one = np.ones(len(edges))
    links = coo_matrix((one, (edges[:, 0], edges[:, 1])), shape=(len(values),) * 2).tocsr()
    links = links + links.T
    degree = np.maximum(1, np.asarray(links.sum(1)).ravel())
    for _ in range(SMOOTHINGS):
        values = (values + links @ values / degree) / 2
    return values


def _first(triangles, alone):
    """The corners of triangles, that one first for which `alone` holds."""
    start = alone.argmax(1)
    rows = np.arange(len(triangles))
    return (triangles[rows, (start + k) % 3] for k in range(3))


class _Cuts:
    """Numbers for new vertices on edges, the same from both sides."""

    def __init__(self, first):
        self.first, self.known, self.pairs = first, {}, []

    def number(self, a, b):
        numbers = np.empty(len(a), dtype=np.int64)
        for i, edge in enumerate(zip(np.minimum(a, b).tolist(), np.maximum(a, b).tolist())):
            if edge not in self.known:
                self.known[edge] = self.first + len(self.pairs)
                self.pairs.append(edge)
            numbers[i] = self.known[edge]
        return numbers

    def ends(self):
        pairs = np.array(self.pairs, dtype=np.int64).reshape(-1, 2)
        return pairs[:, 0], pairs[:, 1]


def _without_small_parts(positions, triangles):
    if not len(triangles):
        return positions[:0], triangles
    links = coo_matrix((np.ones(len(triangles) * 2), (np.hstack([triangles[:, 0], triangles[:, 1]]),
                                                      np.hstack([triangles[:, 1], triangles[:, 2]]))), shape=(len(positions),) * 2)
    part = connected_components(links, directed=False)[1][triangles[:, 0]]
    a, b, c = (positions[triangles[:, k]] for k in range(3))
    area = np.bincount(part, np.linalg.norm(np.cross(b - a, c - a), axis=1))
    triangles = triangles[(area >= SMALLEST_PART * area.sum())[part]]
    used, numbers = np.unique(triangles, return_inverse=True)
    return positions[used], numbers.reshape(-1, 3)
