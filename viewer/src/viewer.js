// What can be done with a model, whoever asks for it: the panel, a key, or a test.
import { Plane, Vector3 } from 'three';
import { clampedRange, rampTexture, sortedValues } from './colour_scale.js';
import { Controls } from './controls.js';
import { Measure } from './measure.js';
import { Picker } from './picking.js';
import { composePicture } from './picture.js';
import { Stage } from './stage.js';
import { shared } from './surface_material.js';

const clickPixels = 4;

export class Viewer {
  constructor(description) {
    this.description = description;
    this.stage = new Stage(document.body);
    this.measure = new Measure(this.stage, document.body);
    this.picker = new Picker(this.stage);
    this.measuring = false;
    this.look = { show: 'plain', attribute: null, flat: false, edges: false, boundary: false };
    this.scale = { ramp: 'Viridis', percent: 1, sorted: new Float32Array() };
    this.clip = { axis: 'none', share: 0.5, flip: false };
    this.pointScale = 1;
    this.onPlace = () => {};
    this.onScale = () => {};
    this.onMeasuring = () => {};
  }

  /** Shows the model; from here on everything else may be called. */
  start(model) {
    this.model = model;
    this.stage.radius = model.radius;
    this.stage.outline = model.outline;
    this.stage.scene.add(model.group);
    this.controls = new Controls(this.stage);
    this.controls.setUp(this.description.up);
    this.stage.beforeDraw.push(() => {
      shared.pixelScale.value = this.stage.pixelScale;
      model.update();
    });
    this.setRamp(this.scale.ramp);
    this.setPointScale(1);
    this.show(model.hasColours ? 'colour' : 'plain');
    this.watchClicks();
    model.onOutline = () => {
      this.stage.outline = model.outline;
      this.controls.home();
    };
  }

  /** `what`: plain, colour, normal, or the key of an attribute. */
  show(what) {
    const attribute = this.model.attributes.has(what) ? what : null;
    this.look = { ...this.look, show: attribute ? 'value' : what, attribute };
    this.applyLook();
    if (attribute) this.measureScale();
  }

  setLook(change) {
    this.look = { ...this.look, ...change };
    this.applyLook();
  }

  applyLook() {
    this.model.setLook(this.look);
    this.stage.draw();
  }

  setLit(lit) {
    shared.lit.value = lit ? 1 : 0;
    this.stage.draw();
  }

  setRamp(name) {
    this.scale.ramp = name;
    shared.ramp.value?.dispose();
    shared.ramp.value = rampTexture(name);
    this.onScale();
    this.stage.draw();
  }

  /** The values of the attribute that is painted, anew. */
  measureScale() {
    this.scale.sorted = sortedValues(this.model.geometries, this.look.attribute);
    this.setPercent(this.scale.percent);
  }

  setPercent(percent) {
    this.scale.percent = percent;
    this.setRange(...clampedRange(this.scale.sorted, percent));
  }

  setRange(low, high) {
    shared.range.value.set(low, high);
    this.onScale();
    this.stage.draw();
  }

  get range() {
    return shared.range.value.toArray();
  }

  setPointScale(scale) {
    this.pointScale = scale;
    shared.pointLength.value = 1.4 * scale * (this.model.spacing ?? this.model.radius / 500);
    this.stage.draw();
  }

  /** Where the clipping plane cuts, in the file's coordinates. */
  get clipPlace() {
    const { axis, share } = this.clip;
    const { box, origin } = this.model;
    return axis === 'none' ? null : origin[axis] + box.min[axis] + share * (box.max[axis] - box.min[axis]);
  }

  setClip(change) {
    this.clip = { ...this.clip, ...change };
    const { axis, flip } = this.clip;
    const { origin } = this.model;
    if (axis === 'none') {
      this.stage.renderer.clippingPlanes = [];
    } else {
      const sign = flip ? 1 : -1;
      const normal = new Vector3();
      normal[axis] = sign;
      this.stage.renderer.clippingPlanes = [new Plane(normal, -sign * (this.clipPlace - origin[axis]))];
    }
    this.stage.draw();
  }

  setMeasuring(on) {
    this.measuring = on;
    document.body.classList.toggle('measuring', on);
    if (!on) this.measure.clear();
    this.onMeasuring(on);
  }

  /** A click that was no drag shows its place, or is an end of what is measured; two of them make it the pivot. */
  watchClicks() {
    const { canvas } = this.stage;
    let down = null;
    canvas.addEventListener('pointerdown', (event) => (down = { x: event.clientX, y: event.clientY }));
    canvas.addEventListener('pointerup', (event) => {
      const still = down && Math.hypot(event.clientX - down.x, event.clientY - down.y) < clickPixels;
      down = null;
      if (still && event.button === 0) this.click(event.clientX, event.clientY);
    });
    canvas.addEventListener('dblclick', (event) => {
      const place = this.picker.at(event.clientX, event.clientY, this.model.group);
      if (place && !this.measuring) this.controls.aim(place);
    });
  }

  click(x, y) {
    const place = this.picker.at(x, y, this.model.group);
    this.onPlace(place ? this.model.origin.clone().add(place) : null);
    if (place && this.measuring) this.measure.add(place);
  }

  async savePicture() {
    this.stage.render();
    const picture = await composePicture(this);
    const link = document.createElement('a');
    link.href = URL.createObjectURL(picture);
    link.download = `${this.description.title.replace(/\.[^.]*$/, '')}.png`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  }

  setTheme(theme) {
    document.documentElement.dataset.theme = theme;
    this.stage.setTheme(theme);
  }
}
