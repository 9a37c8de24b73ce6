// The distance between two places, clicked.
import { Vector3 } from 'three';
import { LineMaterial } from 'three/addons/lines/LineMaterial.js';
import { LineSegments2 } from 'three/addons/lines/LineSegments2.js';
import { LineSegmentsGeometry } from 'three/addons/lines/LineSegmentsGeometry.js';
import { numberText } from './colour_scale.js';

export class Measure {
  constructor(stage, overlay) {
    this.stage = stage;
    this.places = [];
    this.line = new LineSegments2(new LineSegmentsGeometry(), new LineMaterial({ color: '#ffb020', linewidth: 2, depthTest: false }));
    this.line.frustumCulled = false;
    this.line.renderOrder = 3;
    this.line.visible = false;
    this.line.userData.isOverlay = true;
    stage.scene.add(this.line);
    this.marks = [0, 1].map(() => this.element(overlay, 'mark'));
    this.label = this.element(overlay, 'length');
    this.onChange = () => {};
    stage.afterDraw.push(() => this.place());
  }

  element(overlay, name) {
    const element = document.createElement('div');
    element.className = name;
    element.hidden = true;
    overlay.append(element);
    return element;
  }

  add(place) {
    if (this.places.length === 2) this.places = [];
    this.places.push(place);
    this.show();
  }

  clear() {
    this.places = [];
    this.show();
  }

  show() {
    const [a, b] = this.places;
    this.line.visible = Boolean(b);
    if (b) {
      this.line.geometry.setPositions([...a, ...b]);
      this.label.textContent = numberText(this.length, this.length);
    }
    this.onChange();
    this.stage.draw();
  }

  get length() {
    return this.places.length === 2 ? this.places[0].distanceTo(this.places[1]) : null;
  }

  get step() {
    return this.places.length === 2 ? this.places[1].clone().sub(this.places[0]) : null;
  }

  /** Marks and label stay where the places are on the screen. */
  place() {
    this.marks.forEach((mark, index) => this.put(mark, this.onScreen(this.places[index])));
    this.put(this.label, this.labelOnScreen());
  }

  marksOnScreen() {
    return this.places.map((place) => this.onScreen(place)).filter(Boolean);
  }

  labelOnScreen() {
    return this.places.length === 2 ? this.onScreen(this.places[0].clone().lerp(this.places[1], 0.5)) : null;
  }

  /** In the window's pixels; nothing of what is no place, or behind the viewer. */
  onScreen(place) {
    const at = place && new Vector3().copy(place).project(this.stage.camera);
    if (!at || at.z > 1 || at.z < -1) return null;
    return { x: (0.5 + 0.5 * at.x) * window.innerWidth, y: (0.5 - 0.5 * at.y) * window.innerHeight };
  }

  put(element, at) {
    element.hidden = !at;
    if (at) element.style.transform = `translate(${at.x.toFixed(1)}px, ${at.y.toFixed(1)}px) translate(-50%, -50%)`;
  }
}
