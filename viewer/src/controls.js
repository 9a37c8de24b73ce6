// Moving around: orbit around a place, or fly. Keys move in both.
import { Euler, MathUtils, Quaternion, Vector3 } from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';

const axes = { x: new Vector3(1, 0, 0), y: new Vector3(0, 1, 0), z: new Vector3(0, 0, 1) };
const moves = {
  KeyW: [0, 0, -1], ArrowUp: [0, 0, -1], KeyS: [0, 0, 1], ArrowDown: [0, 0, 1],
  KeyA: [-1, 0, 0], ArrowLeft: [-1, 0, 0], KeyD: [1, 0, 0], ArrowRight: [1, 0, 0],
  KeyE: [0, 1, 0], KeyQ: [0, -1, 0],
};

export class Controls {
  constructor(stage) {
    this.stage = stage;
    this.mode = 'orbit';
    this.up = 'y';
    this.pressed = new Set();
    this.last = 0;
    this.target = new Vector3();
    this.makeOrbit();
    const { canvas } = stage;
    canvas.addEventListener('keydown', (event) => this.press(event));
    window.addEventListener('keyup', (event) => this.pressed.delete(event.code));
    window.addEventListener('blur', () => this.pressed.clear());
    canvas.addEventListener('pointerdown', (event) => this.look(event));
    stage.beforeDraw.push((time) => this.step(time));
  }

  /** OrbitControls takes its up axis when it is made. */
  makeOrbit() {
    this.orbit?.dispose();
    this.orbit = new OrbitControls(this.stage.camera, this.stage.canvas);
    this.orbit.target.copy(this.target);
    this.orbit.enableDamping = true;
    this.orbit.dampingFactor = 0.12;
    this.orbit.zoomToCursor = true;
    this.orbit.enabled = this.mode === 'orbit';
    this.orbit.addEventListener('change', () => this.stage.draw());
  }

  setUp(axis) {
    this.up = axis;
    this.stage.camera.up.copy(axes[axis]);
    this.makeOrbit();
    this.home();
  }

  setMode(mode) {
    if (mode === this.mode) return;
    this.mode = mode;
    this.orbit.enabled = mode === 'orbit';
    if (mode === 'orbit') this.aim(this.ahead(Math.min(this.stage.camera.position.length(), this.stage.radius)));
  }

  /** Turn around this place from now on. */
  aim(place) {
    this.target.copy(place);
    this.orbit.target.copy(place);
    this.orbit.update();
    this.stage.draw();
  }

  ahead(distance) {
    const { camera } = this.stage;
    return camera.getWorldDirection(new Vector3()).multiplyScalar(distance).add(camera.position);
  }

  /** All of the model, from its front a little above and aside; or along a direction. */
  home(from) {
    const { camera } = this.stage;
    const { front, right, above } = this.frame();
    const direction = from ?? front.clone().multiplyScalar(0.8).addScaledVector(right, 0.45).addScaledVector(above, 0.35);
    camera.up.copy(axes[this.up]);
    camera.position.copy(direction).normalize();
    camera.lookAt(0, 0, 0);
    camera.position.multiplyScalar(this.distanceFor(camera.quaternion.clone().invert()));
    this.aim(new Vector3());
  }

  /** How far away all of the model just fits into the picture. */
  distanceFor(toCamera) {
    const { camera, outline } = this.stage;
    const room = 1.06;
    const tall = Math.tan(MathUtils.degToRad(camera.fov / 2)) / room, wide = tall * camera.aspect;
    let distance = 0;
    for (const place of outline) {
      const at = place.clone().applyQuaternion(toCamera);
      distance = Math.max(distance, at.z + Math.abs(at.y) / tall, at.z + Math.abs(at.x) / wide);
    }
    return distance || 1;
  }

  /** Where the viewer stands by default, its right and its up, as axes of the file. */
  frame() {
    if (this.up === 'z') return { front: axes.y.clone().negate(), right: axes.x, above: axes.z };
    if (this.up === 'x') return { front: axes.z, right: axes.y, above: axes.x };
    return { front: axes.z, right: axes.x, above: axes.y };
  }

  press(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || !moves[event.code]) return;
    this.pressed.add(event.code);
    event.preventDefault();
  }

  /** Dragging while flying turns the head. */
  look(event) {
    if (this.mode !== 'fly' || event.button !== 0) return;
    const { camera, canvas } = this.stage;
    canvas.setPointerCapture(event.pointerId);
    const level = new Quaternion().setFromUnitVectors(camera.up, axes.y);
    const turn = (drag) => {
      const euler = new Euler().setFromQuaternion(level.clone().multiply(camera.quaternion), 'YXZ');
      euler.y += drag.movementX * 0.003;
      euler.x = MathUtils.clamp(euler.x + drag.movementY * 0.003, -1.55, 1.55);
      euler.z = 0;
      camera.quaternion.copy(level.clone().invert().multiply(new Quaternion().setFromEuler(euler)));
      this.stage.draw();
    };
    canvas.addEventListener('pointermove', turn);
    canvas.addEventListener('lostpointercapture', () => canvas.removeEventListener('pointermove', turn), { once: true });
  }

  step(time) {
    const seconds = Math.min(0.1, (time - this.last) / 1000);
    this.last = time;
    if (this.pressed.size > 0) this.move(seconds);
    if (this.mode === 'orbit') this.orbit.update();
  }

  move(seconds) {
    const { camera, radius } = this.stage;
    const push = new Vector3();
    for (const code of this.pressed) push.add(new Vector3(...moves[code]));
    const near = Math.min(camera.position.distanceTo(this.target), radius);
    const speed = (this.mode === 'fly' ? 0.4 * radius : 0.15 * radius + 0.6 * near) * seconds;
    const lift = push.y;
    push.y = 0;
    push.applyQuaternion(camera.quaternion).addScaledVector(camera.up, lift).multiplyScalar(speed);
    camera.position.add(push);
    this.target.add(push);
    this.orbit.target.copy(this.target);
    this.stage.draw();
  }
}
