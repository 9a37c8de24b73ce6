// Vertices on sharp edges, once for each side: smooth shading would carry an edge far into large triangles.
import { BufferAttribute, Vector3 } from 'three';

/** A vertex whose normal has a smaller cosine (35 degrees) with a triangle's lies on a sharp edge, as for lamina render. */
const sharpCorner = 0.82;
/** Not for a triangle that lies across the normals of all of its vertices, 37 degrees from their mean, as noise leaves them. */
const alongVertices = 0.8;
/** Triangles at a vertex whose normals have a greater one (10 degrees) lie on the same side. */
const sameSide = 0.985;

/** With room for copies of vertices: `from` of each. */
function extended(attribute, from) {
  const source = attribute.isInterleavedBufferAttribute ? attribute.clone() : attribute;
  const { array, itemSize, count, normalized } = source;
  const longer = new array.constructor((count + from.length) * itemSize);
  longer.set(array);
  from.forEach((vertex, i) => longer.copyWithin((count + i) * itemSize, vertex * itemSize, (vertex + 1) * itemSize));
  return new BufferAttribute(longer, itemSize, normalized);
}

/** Gives triangles at sharp edges vertices of their own, with their normals. Vertices that were there keep their numbers. */
export function splitAtCreases(geometry) {
  const { index, attributes: { position, normal } } = geometry;
  if (!index || !normal) return;
  const sides = new Map();  // by vertex: { number, normal } of its copies
  const from = [], normals = [];
  const corners = Array.from({ length: 3 }, () => new Vector3());
  const smooth = corners.map(() => new Vector3());
  const across = new Vector3(), along = new Vector3(), mean = new Vector3();
  const changed = [];  // places in the index, and the vertices to be there
  for (let t = 0; t + 2 < index.count; t += 3) {
    corners.forEach((corner, k) => corner.fromBufferAttribute(position, index.getX(t + k)));
    along.subVectors(corners[2], corners[0]);
    across.subVectors(corners[1], corners[0]).cross(along).normalize();
    mean.set(0, 0, 0);
    smooth.forEach((n, k) => mean.add(n.fromBufferAttribute(normal, index.getX(t + k)).normalize()));
    if (across.lengthSq() === 0 || Math.abs(mean.dot(across)) <= alongVertices * mean.length()) continue;
    for (let k = 0; k < 3; ++k) {
      const vertex = index.getX(t + k);
      if (Math.abs(smooth[k].dot(across)) >= sharpCorner) continue;
      const own = mean.dot(across) < 0 ? across.clone().negate() : across.clone();
      if (!sides.has(vertex)) sides.set(vertex, []);
      let side = sides.get(vertex).find((s) => s.normal.dot(own) > sameSide);
      if (!side) {
        side = { number: position.count + from.length, normal: own };
        sides.get(vertex).push(side);
        from.push(vertex);
        normals.push(own);
      }
      changed.push(t + k, side.number);
    }
  }
  if (from.length === 0) return;
  for (const [name, attribute] of Object.entries(geometry.attributes)) geometry.setAttribute(name, extended(attribute, from));
  normals.forEach((n, i) => geometry.attributes.normal.setXYZ(position.count + i, n.x, n.y, n.z));
  const numbers = new Uint32Array(index.count);
  for (let i = 0; i < index.count; ++i) numbers[i] = index.getX(i);
  for (let i = 0; i < changed.length; i += 2) numbers[changed[i]] = changed[i + 1];
  geometry.setIndex(new BufferAttribute(numbers, 1));
}
