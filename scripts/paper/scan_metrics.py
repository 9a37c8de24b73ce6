"""How good the mesh of a scan is: as the survey of Huang et al. (2022) measures it, and in ways an eye sees and mean distances
hide. Prints JSON:
  scan_metrics.py survey MESH REFERENCE CLOUD
  scan_metrics.py scene MESH TRUTH SEEN SPACING

survey(): lengths in 1e-4 of the reference's diagonal. scene(): lengths in the scan's spacings, shares from 0 to 1.
"""
import json
import os
import sys

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

sys.dont_write_bytecode = True
sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
from paper import meshes  # noqa: E402  (beside this script)

SAMPLES = 200_000
SMALL = 100        # triangles of a part that counts as a flake
LONG = 30          # spacings: shorter boundary loops have no shape
SOFT = 3           # spacings: the bell that smooths a boundary
MISSING, INVENTED = 2, 3   # spacings
SHARP = 30         # degrees: an edge of the truth, beside which normals are not judged


def survey(mesh, reference, cloud):
    """Of PLY files. A reference without triangles has the normals of planes through 16 neighbours."""
    vertices, triangles = meshes.read_ply(reference)
    truth = meshes.positions_of(vertices)
    diagonal = np.linalg.norm(truth.max(0) - truth.min(0))
    truth, truth_normals = _points(truth, triangles) if len(triangles) else (truth, _plane_normals(truth))
    vertices, triangles = meshes.read_ply(mesh)
    positions = meshes.positions_of(vertices)
    points, normals = _points(positions, triangles)
    to_truth, at_truth = cKDTree(truth).query(points)
    to_mesh, at_mesh = cKDTree(points).query(truth)
    facing = np.abs((normals * truth_normals[at_truth]).sum(1)).mean(), np.abs((normals[at_mesh] * truth_normals).sum(1)).mean()
    unit = 1e4 / diagonal
    return {"chamfer": (to_truth.mean() + to_mesh.mean()) / 2 * unit, "accuracy": to_truth.mean() * unit,
            "completeness": to_mesh.mean() * unit, "normal_consistency": sum(facing) / 2
            } | _shape(*_welded(positions, triangles), _spacing_of(cloud))


def scene(mesh, truth, seen, spacing):
    """Of PLY files: the mesh, the truth, and places of the truth that some scanner saw."""
    vertices, triangles = meshes.read_ply(mesh)
    positions, triangles = _welded(meshes.positions_of(vertices), triangles)
    vertices, true_triangles = meshes.read_ply(truth)
    true_positions = meshes.positions_of(vertices)
    places = meshes.positions_of(meshes.read_ply(seen)[0])
    some = np.random.default_rng(1).permutation(len(places))[:SAMPLES]
    points, faces = meshes.sample(positions, triangles, SAMPLES)
    distance, nearest = meshes.NearestTriangle(true_positions, true_triangles, spacing).find(points)
    tilt = _degrees(meshes.face_normals(positions, triangles)[faces],
                    meshes.face_normals(true_positions, true_triangles)[nearest])
    smooth = (distance < INVENTED * spacing) & ~_near_edges(points, true_positions, true_triangles, spacing)
    from_seen = meshes.NearestTriangle(positions, triangles, spacing).find(places[some])[0]
    invented = cKDTree(places).query(points, distance_upper_bound=INVENTED * spacing)[0] == np.inf
    return {"error": np.sqrt((distance ** 2).mean()) / spacing, "missing": (from_seen > MISSING * spacing).mean(),
            "invented": invented.mean(), "flipped": (tilt > 90).mean(),
            "normals": np.percentile(np.minimum(tilt, 180 - tilt)[smooth], 95) if smooth.any() else None,
            } | _shape(positions, triangles, spacing)


def _spacing_of(cloud):
    """The median distance of a cloud's points to their four neighbours."""
    points = meshes.positions_of(meshes.read_ply(cloud)[0])
    some = points[np.random.default_rng(1).permutation(len(points))[:2000]]
    return float(np.median(cKDTree(points).query(some, 5)[0][:, 1:].mean(1)))


def _points(positions, triangles):
    points, faces = meshes.sample(positions, triangles, SAMPLES)
    normals = meshes.face_normals(positions, triangles)[faces]
    return points, normals / np.linalg.norm(normals, axis=1)[:, None]


def _plane_normals(points, neighbours=16):
    around = points[cKDTree(points).query(points, neighbours)[1]]
    around = around - around.mean(1, keepdims=True)
    return np.linalg.eigh(np.einsum("nki,nkj->nij", around, around))[1][:, :, 0]


def _degrees(a, b):
    lengths = np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1)
    return np.degrees(np.arccos(np.clip((a * b).sum(1) / np.where(lengths > 0, lengths, 1), -1, 1)))


def _welded(positions, triangles):
    """Vertices at one position as one, as many readers take them."""
    _, first, number = np.unique(positions.astype(np.float32), axis=0, return_index=True, return_inverse=True)
    triangles = number.reshape(-1)[triangles]
    a, b, c = triangles.T
    return positions[first], triangles[(a != b) & (b != c) & (c != a)]


def _edges(triangles):
    """Sides of all triangles and whose they are; `order` brings those together that are one edge: the first of each, and how
    many they are."""
    edges = np.vstack([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    order = np.lexsort((edges.max(1), edges.min(1)))
    key = np.sort(edges, 1)[order]
    change = np.flatnonzero(np.r_[True, (key[1:] != key[:-1]).any(1), True])
    return edges, np.tile(np.arange(len(triangles)), 3), change[:-1], np.diff(change), order


def _near_edges(points, positions, triangles, spacing):
    """Whether points lie within two spacings of a sharp edge of the truth."""
    positions, triangles = _welded(positions, triangles)
    edges, face, first, count, order = _edges(triangles)
    pair = order[first[count == 2]], order[first[count == 2] + 1]
    normals = meshes.face_normals(positions, triangles)
    sharp = edges[pair[0][_degrees(normals[face[pair[0]]], normals[face[pair[1]]]) > SHARP]]
    if not len(sharp):
        return np.zeros(len(points), dtype=bool)
    start, end = positions[sharp[:, 0]], positions[sharp[:, 1]]
    pieces = np.ceil(np.linalg.norm(end - start, axis=1) / spacing * 4).astype(np.int64).clip(1)
    which = np.repeat(np.arange(len(sharp)), pieces)
    share = (np.arange(len(which)) - np.repeat(np.cumsum(pieces) - pieces, pieces) + 0.5) / pieces[which]
    along = start[which] + share[:, None] * (end - start)[which]
    return cKDTree(along).query(points, distance_upper_bound=2 * spacing)[0] < np.inf


def _shape(positions, triangles, spacing):
    edges, face, first, count, order = _edges(triangles)
    forward = edges[:, 0] < edges[:, 1]
    open_edges = order[first[count == 1]]
    pair = order[first[count == 2]], order[first[count == 2] + 1]
    normals = meshes.face_normals(positions, triangles)
    other = normals[face[pair[1]]] * np.where(forward[pair[0]] == forward[pair[1]], -1, 1)[:, None]
    folds = _degrees(normals[face[pair[0]]], other) > 100
    follows = np.setdiff1d(np.arange(len(order)), first) - 1
    ends = face[order[follows]], face[order[follows + 1]]
    links = coo_matrix((np.ones(len(follows)), ends), shape=(len(triangles),) * 2)
    sizes = np.bincount(connected_components(links, directed=False)[1])
    return {"parts": int(len(sizes)), "flakes": sizes[sizes < SMALL].sum() / len(triangles),
            "folds": folds.mean() if len(folds) else 0.0, "triangles": int(len(triangles)),
            } | _rims(positions, edges[open_edges], spacing)


def _rims(positions, edges, spacing):
    """Boundary loops: how many, how much longer than their smoothed curves, how far they turn at a vertex."""
    following = {}
    for start, end in edges.tolist():
        following.setdefault(start, []).append(end)
    loops, length, soft_length, turned, turned_length = 0, 0.0, 0.0, 0.0, 0.0
    for start in list(following):
        while following.get(start):
            loop, at = [], start
            while following.get(at):
                loop.append(at)
                at = following[at].pop()
                if at == start:
                    break
            loops += 1
            line = positions[loop]
            sides = np.roll(line, -1, 0) - line
            lengths = np.linalg.norm(sides, axis=1)
            if lengths.sum() < LONG * spacing:
                continue
            both = lengths + np.roll(lengths, 1)
            turned += (both * _degrees(np.roll(sides, 1, 0), sides)).sum()
            turned_length += both.sum()
            length += lengths.sum()
            soft_length += _soft_length(line, lengths, spacing)
    return {"loops": loops, "ragged": length / soft_length if soft_length else 1.0,
            "turn": turned / turned_length if turned_length else 0.0}


def _soft_length(line, lengths, spacing):
    step = spacing / 2
    along = np.r_[0, np.cumsum(lengths)]
    at = np.arange(0, along[-1], step)
    closed = np.vstack([line, line[:1]])
    even = np.stack([np.interp(at, along, closed[:, k]) for k in range(3)], 1)
    reach = 6 * SOFT
    offsets = np.arange(-reach, reach + 1)
    weights = np.exp(-((offsets * 0.5 / SOFT) ** 2) / 2)
    soft = sum(w * np.roll(even, d, 0) for w, d in zip(weights / weights.sum(), offsets))
    return np.linalg.norm(np.roll(soft, -1, 0) - soft, axis=1).sum()


def main():
    kind, *words = sys.argv[1:]
    figures = survey(*words) if kind == "survey" else scene(*words[:3], float(words[3]))
    print(json.dumps({key: value.item() if hasattr(value, "item") else value for key, value in figures.items()}))


if __name__ == "__main__":
    main()
