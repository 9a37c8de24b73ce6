// A mesh or a cloud out of the page: its drawables, where it lies, and what can be painted on it.
import { Box3, Group, Mesh, ShaderMaterial, Vector3 } from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { boundaryLines } from './boundary.js';
import { splitAtCreases } from './creases.js';
import { readBlock } from './data.js';
import { makeMaterial, shared } from './surface_material.js';

/** What is painted under which name: glTF's attribute of "curvature" is "_CURVATURE", three's "_curvature". */
export function attributesOf(geometry, parser) {
  const names = new Map();
  for (const key of Object.keys(geometry.attributes)) {
    if (key.startsWith('_') && geometry.attributes[key].itemSize === 1) names.set(key, key.slice(1));
  }
  for (const mesh of parser?.json.meshes ?? []) {
    for (const primitive of mesh.primitives) {
      for (const [semantic, accessor] of Object.entries(primitive.attributes)) {
        const key = semantic.toLowerCase();
        const { name } = parser.json.accessors[accessor];
        if (names.has(key) && name) names.set(key, name);
      }
    }
  }
  return names;
}

const edgeVertexShader = /* glsl */ `
#include <clipping_planes_pars_vertex>
uniform float edgeLength;
uniform float pixelScale;
varying float strength;
void main() {
  vec4 mvPosition = modelViewMatrix * vec4(position, 1.0);
  gl_Position = projectionMatrix * mvPosition;
  // Edges of a few pixels would hide the surface.
  strength = clamp(edgeLength * length(modelMatrix[0].xyz) * pixelScale / max(-mvPosition.z, 1e-9) / 16.0, 0.02, 0.65);
  #include <clipping_planes_vertex>
}
`;

const edgeFragmentShader = /* glsl */ `
#include <clipping_planes_pars_fragment>
varying float strength;
void main() {
  #include <clipping_planes_fragment>
  gl_FragColor = vec4(0.03, 0.04, 0.06, strength);
}
`;

function makeEdges(geometry) {
  const edges = new Mesh(geometry, new ShaderMaterial({
    vertexShader: edgeVertexShader,
    fragmentShader: edgeFragmentShader,
    uniforms: { edgeLength: { value: meanEdge(geometry) }, pixelScale: shared.pixelScale },
    wireframe: true,
    transparent: true,
    depthWrite: false,
    clipping: true,
  }));
  edges.frustumCulled = false;
  edges.userData.isOverlay = true;
  return edges;
}

/** Of some of the edges. */
function meanEdge(geometry) {
  const positions = geometry.getAttribute('position');
  const { index } = geometry;
  const triangles = (index ?? positions).count / 3;
  const step = Math.max(1, Math.floor(triangles / 2000));
  const a = new Vector3(), b = new Vector3();
  let sum = 0, count = 0;
  for (let t = 0; t < triangles; t += step, ++count) {
    a.fromBufferAttribute(positions, index ? index.getX(3 * t) : 3 * t);
    b.fromBufferAttribute(positions, index ? index.getX(3 * t + 1) : 3 * t + 1);
    sum += a.distanceTo(b);
  }
  return count > 0 ? sum / count : 0;
}

/** Gives a drawable the look asked for; its geometry's `value` is the attribute to paint. */
export function dress(drawable, look) {
  const { geometry } = drawable;
  const painted = look.show === 'value' ? geometry.getAttribute(look.attribute) : null;
  if (painted) geometry.setAttribute('value', painted);
  else geometry.deleteAttribute('value');
  drawable.material.dispose();
  drawable.material = makeMaterial(geometry, Boolean(drawable.isPoints), look);
  if (drawable.isPoints) return;
  let edges = drawable.userData.edges;
  if (look.edges && !edges) {
    edges = drawable.userData.edges = makeEdges(geometry);
    drawable.add(edges);
    edges.updateMatrixWorld(true);  // tiles that are in the scene already are not looked at again
  }
  if (edges) edges.visible = look.edges;
}

export class Model {
  /** Reads the page's blocks. */
  static async load(description) {
    const gltf = await new GLTFLoader().parseAsync(await readBlock('model'), '');
    const found = [];
    gltf.scene.updateMatrixWorld(true);
    gltf.scene.traverse((object) => object.isMesh || object.isPoints ? found.push(object) : null);
    if (found.length !== 1) throw new Error(`the page holds ${found.length} models instead of one`);
    return new Model(description, found[0], gltf.parser, await readBlock('boundary'));
  }

  constructor(description, drawable, parser, boundary) {
    this.kind = description.kind;
    this.drawables = [drawable];
    this.geometries = [drawable.geometry];
    this.attributes = attributesOf(drawable.geometry, parser);
    this.hasColours = drawable.geometry.hasAttribute('color');
    if (this.kind === 'mesh' && !drawable.geometry.hasAttribute('normal')) drawable.geometry.computeVertexNormals();
    if (this.kind === 'mesh') splitAtCreases(drawable.geometry);
    drawable.geometry.computeBoundingBox();
    const box = drawable.geometry.boundingBox;
    const middle = box.getCenter(new Vector3());
    // Floats stay as they are; the scene's origin is the middle of the box, whose place is known in double.
    const placed = drawable.getWorldPosition(new Vector3());
    this.origin = placed.clone().add(middle);
    this.box = new Box3().copy(box).translate(middle.clone().negate());
    this.radius = 0.5 * box.getSize(new Vector3()).length() || 1;
    this.outline = someOf(drawable.geometry).map((place) => place.sub(middle));
    this.group = new Group();
    drawable.removeFromParent();
    drawable.position.copy(middle).negate();
    drawable.quaternion.identity();
    drawable.scale.setScalar(1);
    drawable.frustumCulled = false;
    this.group.add(drawable);
    if (this.kind === 'points') this.spacing = spacingOf(drawable.geometry, box);
    if (boundary) this.addBoundary(drawable, new Uint32Array(boundary));
  }

  addBoundary(drawable, ends) {
    const positions = drawable.geometry.getAttribute('position');
    const places = new Float32Array(3 * ends.length);
    for (let i = 0; i < ends.length; ++i) {
      places.set([positions.getX(ends[i]), positions.getY(ends[i]), positions.getZ(ends[i])], 3 * i);
    }
    this.boundary = boundaryLines(places);
    this.boundary.position.copy(drawable.position);
    this.boundary.visible = false;
    this.group.add(this.boundary);
  }

  get hasBoundary() {
    return Boolean(this.boundary);
  }

  setLook(look) {
    for (const drawable of this.drawables) dress(drawable, look);
    if (this.boundary) this.boundary.visible = look.boundary;
  }

  update() {}
}

/** A few thousand of the vertices. */
export function someOf(geometry) {
  const positions = geometry.getAttribute('position');
  const step = Math.max(1, Math.floor(positions.count / 5000));
  const places = [];
  for (let i = 0; i < positions.count; i += step) {
    places.push(new Vector3().fromBufferAttribute(positions, i));
  }
  return places;
}

/** How far apart neighbouring points are, about: cells of a grid that hold points are counted, some points in each. */
function spacingOf(geometry, box) {
  const positions = geometry.getAttribute('position');
  const size = box.getSize(new Vector3());
  const extent = Math.max(size.x, size.y, size.z) || 1;
  const step = Math.max(1, Math.floor(positions.count / 2e6));
  const looked = Math.ceil(positions.count / step);
  for (let steps = 256; ; steps /= 2) {
    const side = extent / steps;
    const cells = new Set();
    for (let i = 0; i < positions.count; i += step) {
      const x = Math.floor((positions.getX(i) - box.min.x) / side);
      const y = Math.floor((positions.getY(i) - box.min.y) / side);
      const z = Math.floor((positions.getZ(i) - box.min.z) / side);
      cells.add((x * 512 + y) * 512 + z);
    }
    // A surface fills some 1.5 cells for each that its own area has.
    if (4 * cells.size < looked || steps === 1) return side * Math.sqrt(cells.size / positions.count / 1.5);
  }
}
