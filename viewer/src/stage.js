// The canvas, the camera and when to draw: only after something changed.
import { CanvasTexture, PerspectiveCamera, Scene, SRGBColorSpace, Vector2, WebGLRenderer } from 'three';

const backgrounds = {
  dark: ['#2b2f36', '#14161a'],
  light: ['#fdfdfc', '#d9dde2'],
};

function gradient([above, below]) {
  const canvas = document.createElement('canvas');
  canvas.width = 2;
  canvas.height = 256;
  const context = canvas.getContext('2d');
  const fill = context.createLinearGradient(0, 0, 0, canvas.height);
  fill.addColorStop(0, above);
  fill.addColorStop(1, below);
  context.fillStyle = fill;
  context.fillRect(0, 0, canvas.width, canvas.height);
  const texture = new CanvasTexture(canvas);
  texture.colorSpace = SRGBColorSpace;
  return texture;
}

const sizes = new Vector2();

/** The scene lies around its own origin; where that is in the file's coordinates, the model knows. */
export class Stage {
  constructor(parent) {
    this.renderer = new WebGLRenderer({ antialias: true, powerPreference: 'high-performance' });
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.renderer.domElement.tabIndex = 0;
    this.renderer.domElement.setAttribute('role', 'img');
    parent.append(this.renderer.domElement);
    this.scene = new Scene();
    this.camera = new PerspectiveCamera(45, 1, 0.01, 1000);
    this.radius = 1;
    this.outline = [];  // places that a picture of everything has to show
    this.covered = 0;
    this.drawing = false;
    this.steps = [];  // milliseconds between frames that followed each other
    this.drawnAt = this.endedAt = this.askedAt = -Infinity;
    this.beforeDraw = [];
    this.afterDraw = [];
    this.setTheme('dark');
    window.addEventListener('resize', () => this.resize());
    this.resize();
    this.renderer.setAnimationLoop((time) => this.frame(time));
  }

  get canvas() {
    return this.renderer.domElement;
  }

  setTheme(theme) {
    this.scene.background?.dispose();
    this.scene.background = gradient(backgrounds[theme]);
    this.draw();
  }

  resize() {
    const width = Math.max(1, window.innerWidth), height = Math.max(1, window.innerHeight);
    this.renderer.setSize(width, height);
    this.centre();
  }

  /** The model stands in the middle of what the panel, so many pixels of the left, leaves free. */
  setCovered(pixels) {
    this.covered = pixels;
    this.centre();
  }

  centre() {
    const { x, y } = this.renderer.getSize(sizes);
    const covered = x > 2.5 * this.covered ? this.covered : 0;
    this.camera.aspect = (x - covered) / y;
    this.camera.setViewOffset(x - covered, y, -covered, 0, x, y);
    this.draw();
  }

  /** Wants a picture with the next frame. */
  draw() {
    if (!this.drawing) this.askedAt = performance.now();
    this.drawing = true;
  }

  frame(time) {
    for (const step of this.beforeDraw) step(time);
    if (!this.drawing) return;
    this.drawing = false;
    this.render();
    this.clock(time);
    for (const step of this.afterDraw) step();
    this.endedAt = performance.now();
  }

  /** Frames are drawn on demand: one that nobody asked for for a while says nothing of how fast they come. */
  clock(time) {
    const pause = 250;
    if (this.askedAt - this.endedAt > pause) this.steps = [];
    else this.steps = [...this.steps.slice(-29), time - this.drawnAt];
    this.drawnAt = time;
  }

  /** Frames a second of the last ones, while there is movement; else nothing. */
  get framesPerSecond() {
    return this.steps.length < 3 ? null : (1000 * this.steps.length) / this.steps.reduce((sum, step) => sum + step, 0);
  }

  /** Near and far planes as close around the model as the camera's place allows. */
  adjustDepth() {
    const distance = this.camera.position.length();
    this.camera.far = distance + 1.05 * this.radius;
    this.camera.near = Math.max(distance - 1.05 * this.radius, this.radius * 2e-4, this.camera.far * 2e-5);
    this.camera.updateProjectionMatrix();
    this.camera.updateMatrixWorld();
  }

  /** Pixels of a length of 1 at a distance of 1. */
  get pixelScale() {
    const height = this.renderer.getDrawingBufferSize(sizes).y;
    return height / (2 * Math.tan((this.camera.fov * Math.PI) / 360));
  }

  /** At once, so that the canvas can be copied: a browser may clear it after its frame. */
  render() {
    this.adjustDepth();
    this.renderer.render(this.scene, this.camera);
  }
}
