// A tile set: drawn in the detail that the view wants, out of the page or from the server that served it.
import { Box3, Frustum, Group, Matrix4, Vector3 } from 'three';
import { MeshoptDecoder } from 'three/addons/libs/meshopt_decoder.module.js';
import { TilesRenderer } from '3d-tiles-renderer';
import { GLTFExtensionsPlugin } from '3d-tiles-renderer/plugins';
import { boundaryLines, disposeLines, TileBoundary } from './boundary.js';
import { blockNames, readBlock } from './data.js';
import { attributesOf, dress, someOf } from './model.js';

const mediaTypes = { json: 'application/json', glb: 'model/gltf-binary' };

/** Files that stand in the page are taken from there. The name of the host is made up: none is ever asked. */
const pageRoot = 'https://page.invalid/';

class PageFilesPlugin {
  constructor() {
    this.name = 'PAGE_FILES_PLUGIN';
    this.names = blockNames('file:');
  }

  async fetchData(url) {
    const name = decodeURI(new URL(url, pageRoot).pathname.replace(/^\/+/, ''));
    if (!this.names.has(name)) return new Response(null, { status: 404, statusText: `${name} is not in the page` });
    const type = mediaTypes[name.split('.').pop()] ?? 'application/octet-stream';
    return new Response(await readBlock(`file:${name}`, { keep: true }), { headers: { 'Content-Type': type } });
  }
}

export class TileModel {
  static async load(description, stage) {
    const model = new TileModel(description, stage);
    await model.ready;
    return model;
  }

  constructor(description, stage) {
    this.kind = 'tiles';
    this.stage = stage;
    this.geometries = [];
    this.attributes = new Map();
    this.hasColours = false;
    this.look = { show: 'plain' };
    this.rims = new TileBoundary();
    this.boundary = null;
    this.boundaryEdges = 0;
    this.boundaryIsOld = true;
    this.group = new Group();
    this.origin = new Vector3();
    this.box = new Box3();
    this.tiles = new TilesRenderer(description.embedded ? `${pageRoot}tileset.json` : description.tileset);
    if (description.embedded) this.tiles.registerPlugin(new PageFilesPlugin());
    this.tiles.registerPlugin(new GLTFExtensionsPlugin({ meshoptDecoder: MeshoptDecoder }));
    this.tiles.errorTarget = 1;
    this.tiles.setCamera(stage.camera);
    this.group.add(this.tiles.group);
    this.onChange = () => {};
    this.onOutline = () => {};
    this.listen();
  }

  listen() {
    const { tiles } = this;
    tiles.addEventListener('load-model', ({ scene }) => this.addTile(scene));
    tiles.addEventListener('dispose-model', ({ scene }) => this.removeTile(scene));
    for (const event of ['needs-update', 'needs-render', 'tile-visibility-change', 'tiles-load-end']) {
      tiles.addEventListener(event, () => this.stage.draw());
    }
    tiles.addEventListener('tile-visibility-change', () => (this.boundaryIsOld = true));
    tiles.addEventListener('load-error', ({ url, error }) => console.error(`${url}: ${error.message}`));
    this.ready = new Promise((resolve, reject) => {
      tiles.addEventListener('load-root-tileset', () => {
        this.place();
        resolve();
      });
      tiles.addEventListener('load-error', ({ error }) => reject(error));
      tiles.update();
    });
  }

  /** The scene's origin goes to the middle of the tiles. A tile set on the globe is shown in the frame of its root. */
  place() {
    const { tiles } = this;
    const given = tiles.root.transform;
    const root = given ? new Matrix4().fromArray(given) : new Matrix4();
    const turned = [0, 5, 10].some((k) => Math.abs(root.elements[k] - 1) > 1e-9);
    tiles.getOrientedBoundingBox(this.box, placement);
    const corners = this.box.clone();
    const toRoot = turned ? root.clone().invert() : new Matrix4();
    corners.applyMatrix4(new Matrix4().multiplyMatrices(toRoot, placement));
    corners.getCenter(this.origin);
    const middle = this.origin.clone();
    const said = tiles.rootTileset?.asset?.extras;
    if (turned && said?.origin) this.origin.add(new Vector3(...said.origin));
    // Only of these it is known that neighbouring tiles have the same positions where they meet.
    this.hasBoundary = /^lamina\b/.test(said?.generator ?? '');
    this.countAll();
    // Well-known text begins with the system's name.
    if (said?.crs) this.crs = said.crs.match(/"([^"]+)"/)?.[1] ?? said.crs;
    this.radius = 0.5 * corners.getSize(new Vector3()).length() || 1;
    this.box.copy(corners).translate(middle.clone().negate());
    const ends = [this.box.min, this.box.max];
    this.outline = [0, 1, 2, 3, 4, 5, 6, 7].map((k) => new Vector3(ends[k & 1].x, ends[(k >> 1) & 1].y, ends[k >> 2].z));
    // As it is: a map's scale turned back is no position, rotation and scale, and at the Earth's radius that shows.
    tiles.group.matrixAutoUpdate = false;
    tiles.group.matrix.makeTranslation(-middle.x, -middle.y, -middle.z).multiply(toRoot);
    tiles.group.matrixWorldNeedsUpdate = true;
    tiles.group.updateMatrixWorld(true);
  }

  /** What the leaves hold, where the tile set says so. */
  countAll() {
    const all = { triangles: 0, tiles: 0, levels: 0 };
    const visit = (tile, level) => {
      ++all.tiles;
      all.levels = Math.max(all.levels, level);
      if (!tile.children?.length) all.triangles += tile.extras?.triangles ?? NaN;
      tile.children?.forEach((child) => visit(child, level + 1));
    };
    visit(this.tiles.root, 1);
    this.all = all;
  }

  addTile(scene) {
    if (this.geometries.length === 0) this.trace(scene);
    scene.traverse((object) => {
      if (!object.isMesh && !object.isPoints) return;
      const { geometry } = object;
      this.geometries.push(geometry);
      if (!geometry.hasAttribute('normal') && object.isMesh) geometry.computeVertexNormals();
      for (const [key, name] of attributesOf(geometry)) this.attributes.set(key, name);
      this.hasColours ||= geometry.hasAttribute('color');
      dress(object, this.look);
    });
    this.onChange();
    this.stage.draw();
  }

  /** The first tile has the coarse shape of all: a better outline than the box. */
  trace(scene) {
    const places = [];
    scene.updateMatrixWorld(true);
    scene.traverse((object) => {
      if (!object.isMesh && !object.isPoints) return;
      const toScene = new Matrix4().multiplyMatrices(this.tiles.group.matrixWorld, object.matrixWorld);
      places.push(...someOf(object.geometry).map((place) => place.applyMatrix4(toScene)));
    });
    this.outline = places;
    this.onOutline();
  }

  removeTile(scene) {
    scene.traverse((object) => {
      if (!object.geometry || object.userData.isOverlay) return;
      this.geometries = this.geometries.filter((geometry) => geometry !== object.geometry);
    });
  }

  setLook(look) {
    this.boundaryIsOld ||= look.boundary !== this.look.boundary;
    this.look = look;
    this.tiles.forEachLoadedModel((scene) => {
      const drawables = [];
      scene.traverse((object) => ((object.isMesh || object.isPoints) && !object.userData.isOverlay ? drawables.push(object) : null));
      for (const drawable of drawables) dress(drawable, look);
    });
  }

  get error() {
    return this.tiles.errorTarget;
  }

  set error(pixels) {
    this.tiles.errorTarget = pixels;
    this.stage.draw();
  }

  update() {
    this.stage.camera.updateMatrixWorld();
    this.tiles.setResolutionFromRenderer(this.stage.camera, this.stage.renderer);
    this.tiles.update();
    if (this.boundaryIsOld) this.drawBoundary();
  }

  /** The boundary of what is drawn: tiles out of sight have theirs out of sight, too. */
  drawBoundary() {
    this.boundaryIsOld = false;
    this.boundary?.removeFromParent();
    if (this.boundary) disposeLines(this.boundary);
    this.boundary = null;
    this.boundaryEdges = 0;
    if (!this.look.boundary) return;
    const scenes = [...this.tiles.visibleTiles].map((tile) => tile.engineData?.scene).filter(Boolean);
    const places = this.rims.placesOf(scenes);
    this.boundaryEdges = places.length / 6;
    if (places.length === 0) return;
    this.boundary = boundaryLines(places);
    this.boundary.matrixAutoUpdate = false;
    this.boundary.matrix.multiplyMatrices(this.tiles.group.matrixWorld, scenes[0].matrix);
    this.group.add(this.boundary);
    this.stage.draw();
  }

  get loading() {
    const { stats } = this.tiles;
    return stats.queued + stats.downloading + stats.parsing > 0;
  }

  /** What is drawn at the moment. */
  shown() {
    const levels = new Map();
    let triangles = 0;
    for (const tile of this.tiles.visibleTiles) {
      const level = tile.internal.depth;
      levels.set(level, (levels.get(level) ?? 0) + 1);
      tile.engineData?.scene?.traverse((object) => {
        if (object.isMesh && !object.userData.isOverlay) {
          triangles += (object.geometry.index ?? object.geometry.getAttribute('position')).count / 3;
        }
      });
    }
    return { tiles: this.tiles.visibleTiles.size, triangles, levels, boundaryEdges: this.look.boundary && this.seesAll() ? this.boundaryEdges : null };
  }

  /** Whether the picture has all of it. Else tiles out of it are not drawn, and tiles end where those begin. */
  seesAll() {
    const { camera } = this.stage;
    sight.setFromProjectionMatrix(product.multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse));
    return this.outline.every((place) => sight.containsPoint(place));
  }
}

const placement = new Matrix4(), product = new Matrix4();
const sight = new Frustum();
