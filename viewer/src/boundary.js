// Edges of one triangle, as lines: strong where they are seen, faint where the surface hides them.
import { Group, Matrix4, Vector3 } from 'three';
import { LineMaterial } from 'three/addons/lines/LineMaterial.js';
import { LineSegments2 } from 'three/addons/lines/LineSegments2.js';
import { LineSegmentsGeometry } from 'three/addons/lines/LineSegmentsGeometry.js';

/** `places`: both ends of every edge, three numbers each. */
export function boundaryLines(places) {
  const geometry = new LineSegmentsGeometry().setPositions(places);
  const group = new Group();
  for (const [opacity, depthTest] of [[0.3, false], [1, true]]) {
    const material = new LineMaterial({ color: '#ff4a3d', linewidth: 2.5, opacity, depthTest, transparent: true, clipping: true });
    const lines = new LineSegments2(geometry, material);
    lines.frustumCulled = false;
    lines.renderOrder = 2;
    lines.userData.isOverlay = true;
    group.add(lines);
  }
  return group;
}

export function disposeLines(group) {
  for (const lines of group.children) {
    lines.geometry.dispose();
    lines.material.dispose();
  }
}

/** Pairs of vertices that are an edge of one triangle. */
function edgesOfOne({ index, attributes }) {
  const vertices = attributes.position.count;
  const corners = (index ?? attributes.position).count;
  const cornerAt = (i) => (index ? index.getX(i) : i);
  const edges = new Map();
  for (let t = 0; t + 2 < corners; t += 3) {
    const corner = [cornerAt(t), cornerAt(t + 1), cornerAt(t + 2)];
    for (let k = 0; k < 3; ++k) {
      const a = corner[k], b = corner[(k + 1) % 3];
      const key = a < b ? a * vertices + b : b * vertices + a;
      edges.set(key, (edges.get(key) ?? 0) + 1);
    }
  }
  return [...edges].filter(([, uses]) => uses === 1).map(([key]) => [Math.floor(key / vertices), key % vertices]);
}

/**
 * The edges of one triangle in all tiles that are drawn. A tile has such edges where it meets its neighbours, too; there
 * both have the same ones, since positions of all tiles are steps of one lattice and compare as numbers.
 */
export class TileBoundary {
  constructor() {
    this.rims = new WeakMap();  // of tiles that were looked at: edges by what tells them apart
  }

  /** By the text of its ends, each edge of one triangle of a tile: six numbers in the tile's own frame. */
  rimOf(scene) {
    let rim = this.rims.get(scene);
    if (rim) return rim;
    rim = new Map();
    scene.traverse((object) => {
      if (!object.isMesh || object.userData.isOverlay) return;
      const positions = object.geometry.attributes.position;
      const toTile = new Matrix4();
      for (let part = object; part !== scene; part = part.parent) {
        part.updateMatrix();
        toTile.premultiply(part.matrix);
      }
      for (const [a, b] of edgesOfOne(object.geometry)) {
        const ends = [a, b].map((i) => new Vector3().fromBufferAttribute(positions, i).applyMatrix4(toTile).toArray());
        toggle(rim, ends.map(String).sort().join(' '), ends.flat());
      }
    });
    this.rims.set(scene, rim);
    return rim;
  }

  /** Both ends of every edge, in the frame that all tiles share. */
  placesOf(scenes) {
    const edges = new Map();
    for (const scene of scenes) {
      for (const [key, ends] of this.rimOf(scene)) toggle(edges, key, ends);
    }
    return [...edges.values()].flat();
  }
}

/** What comes twice is an edge of two triangles. */
function toggle(edges, key, ends) {
  if (!edges.delete(key)) edges.set(key, ends);
}
