// The panel: what is shown, and everything that can be set.
import { clampedRange, countText, numberText, rampGradient, ramps } from './colour_scale.js';
import { button, check, choice, make, section, select, slider } from './dom.js';
import { Help } from './help.js';

const shading = [['smooth', 'Smooth'], ['flat', 'Flat']];
const percents = [['0', 'All values'], ['1', '1 to 99 %'], ['2', '2 to 98 %'], ['5', '5 to 95 %'], ['own', 'By hand']];
const clipAxes = [['none', 'Off'], ['x', 'x'], ['y', 'y'], ['z', 'z']];

export class Panel {
  constructor(viewer) {
    this.viewer = viewer;
    this.help = new Help();
    this.facts = make('div', { className: 'facts' });
    this.fold = button('–', 'Fold the panel (H)', () => this.toggle());
    this.fold.className = 'icon';
    this.fold.setAttribute('aria-expanded', 'true');
    const sections = [
      this.appearance(), this.cut(), this.measuring(), this.detail(), this.view(),
    ].filter(Boolean);
    this.root = make('aside', { className: 'panel', ariaLabel: 'Viewer' },
      make('header', {}, make('h1', { textContent: viewer.description.title, title: viewer.description.title }), this.fold,
        this.facts),
      make('div', { className: 'body' }, ...sections));
    this.place = make('div', { className: 'place', hidden: true });
    this.place.setAttribute('role', 'status');
    document.body.append(this.root, this.place, this.help.dialog);
    viewer.onPlace = (place) => this.showPlace(place);
    viewer.onScale = () => this.showScale();
    this.showFacts();
  }

  toggle() {
    const folded = this.root.classList.toggle('folded');
    this.fold.textContent = folded ? '+' : '–';
    this.fold.setAttribute('aria-expanded', String(!folded));
    this.viewer.stage.setCovered(this.covers);
  }

  /** Pixels of the window's left. */
  get covers() {
    return this.root.classList.contains('folded') ? 0 : this.root.getBoundingClientRect().right;
  }

  get mesh() {
    return this.viewer.model.kind !== 'points';
  }

  showChoices() {
    const { model } = this.viewer;
    const list = [['plain', 'Plain']];
    if (model.hasColours) list.unshift(['colour', 'Colours']);
    if (this.mesh || model.geometries[0].hasAttribute('normal')) list.push(['normal', 'Normals']);
    return list.concat([...model.attributes].map(([key, name]) => [key, name]));
  }

  appearance() {
    const { viewer } = this;
    const { look, model } = viewer;
    this.shows = select('Show', this.showChoices(), look.attribute ?? look.show, (what) => this.show(what));
    this.shading = choice('Shading', shading, 'smooth', (key) => viewer.setLook({ flat: key === 'flat' }));
    this.edges = check('Edges', false, (on) => viewer.setLook({ edges: on }));
    this.boundary = check('Boundary loops', false, (on) => viewer.setLook({ boundary: on }));
    this.light = check('Light', true, (on) => viewer.setLit(on));
    const checks = make('div', { className: 'checks' }, this.light.row);
    if (this.mesh) checks.append(this.edges.row);
    if (model.hasBoundary) checks.append(this.boundary.row);
    const rows = [this.shows.row, this.makeScale()];
    if (this.mesh) rows.push(this.shading.row);
    if (!this.mesh) {
      this.points = slider('Point size', { min: -3, max: 3, step: 0.25, value: 0, show: (v) => `${(2 ** v).toFixed(2)} ×` },
        (v) => viewer.setPointScale(2 ** v));
      rows.push(this.points.row);
    }
    return section('Appearance', ...rows, checks);
  }

  show(what) {
    this.viewer.show(what);
    this.shows.control.value = what;
    this.scale.hidden = !this.viewer.look.attribute;
    this.showScale();
  }

  makeScale() {
    const { viewer } = this;
    this.ramp = make('div', { className: 'ramp' });
    this.ramp.setAttribute('role', 'img');
    const end = (name) => {
      const field = make('input', { type: 'number', step: 'any', ariaLabel: name, title: name });
      field.onchange = () => {
        viewer.setRange(Number(this.low.value), Number(this.high.value));
        this.percent.control.value = 'own';
      };
      return field;
    };
    this.low = end('Value of the first colour');
    this.high = end('Value of the last colour');
    this.percent = select('Range', percents, '1', (key) => (key === 'own' ? this.low.focus() : viewer.setPercent(Number(key))));
    this.ramps = select('Scale', Object.keys(ramps).map((name) => [name, name]), 'Viridis', (name) => viewer.setRamp(name));
    this.scale = make('div', { className: 'scale', hidden: true }, this.ramp,
      make('div', { className: 'ends' }, this.low, this.high), this.percent.row, this.ramps.row);
    return this.scale;
  }

  showScale() {
    const { range, scale, look, model } = this.viewer;
    const [least, most] = clampedRange(scale.sorted, 0);
    const span = range[1] - range[0] || Math.abs(range[0]) || 1;
    this.low.value = numberText(range[0], span);
    this.high.value = numberText(range[1], span);
    this.ramp.style.background = rampGradient(scale.ramp);
    const name = model.attributes.get(look.attribute) ?? '';
    this.ramp.title = `${name}: ${numberText(least, span)} to ${numberText(most, span)}`;
    this.ramp.setAttribute('aria-label', this.ramp.title);
  }

  cut() {
    const { viewer } = this;
    const refresh = () => {
      this.position.refresh();
      more.hidden = viewer.clip.axis === 'none';
    };
    this.clip = choice('Axis', clipAxes, 'none', (axis) => {
      viewer.setClip({ axis });
      refresh();
    });
    this.position = slider('Position', { min: 0, max: 1, step: 0.001, value: 0.5, show: () => this.clipText() },
      (share) => {
        viewer.setClip({ share });
        this.position.refresh();
      });
    this.flip = check('Other side', false, (flip) => viewer.setClip({ flip }));
    const more = make('div', { className: 'scale', hidden: true }, this.position.row, this.flip.row);
    this.position.row.style.gridTemplateColumns = '60px 1fr auto';
    return section('Clipping plane', this.clip.row, more);
  }

  clipText() {
    const { clipPlace, model } = this.viewer;
    return clipPlace === null ? '' : numberText(clipPlace, 0.1 * model.radius);
  }

  measuring() {
    const { viewer } = this;
    const { measure } = viewer;
    this.measure = button('Measure a distance', 'Click two places (M)', () => viewer.setMeasuring(!viewer.measuring));
    this.measure.setAttribute('aria-pressed', 'false');
    const length = make('div', { className: 'value large', hidden: true });
    const parts = make('div', { className: 'hint value', hidden: true });
    const hint = make('div', { className: 'hint', hidden: true, textContent: 'Click the first place.' });
    const refresh = () => {
      const { step } = measure;
      length.hidden = parts.hidden = !step;
      hint.hidden = !viewer.measuring || Boolean(step);
      hint.textContent = measure.places.length === 0 ? 'Click the first place.' : 'Click the second place.';
      if (!step) return;
      const text = (value) => numberText(value, measure.length);
      length.textContent = text(measure.length);
      parts.textContent = `Δx ${text(step.x)}   Δy ${text(step.y)}   Δz ${text(step.z)}`;
    };
    measure.onChange = refresh;
    viewer.onMeasuring = (on) => {
      this.measure.setAttribute('aria-pressed', String(on));
      refresh();
    };
    const result = make('div', {}, hint, length, parts);
    result.setAttribute('aria-live', 'polite');
    return section('Distance', this.measure, result);
  }

  detail() {
    const { viewer } = this;
    if (viewer.model.kind !== 'tiles') return null;
    this.shown = make('div', { className: 'value hint drawn' });
    this.error = slider('Screen error', { min: -2, max: 6, step: 0.25, value: 0, show: (v) => `${(2 ** v).toFixed(v < 0 ? 2 : 1)} px` },
      (v) => (viewer.model.error = 2 ** v));
    viewer.stage.afterDraw.push(() => this.showTiles());
    viewer.model.onChange = () => this.tilesChanged();
    return section('Detail', this.error.row, this.shown);
  }

  showTiles() {
    const { tiles, triangles, levels, boundaryEdges } = this.viewer.model.shown();
    const sorted = [...levels.keys()].sort((a, b) => a - b);
    const span = sorted.length > 1 ? `levels ${sorted[0]} to ${sorted.at(-1)}` : `level ${sorted[0] ?? '–'}`;
    const text = `${countText(triangles)} triangles in ${countText(tiles)} ${tiles === 1 ? 'tile' : 'tiles'}, ${span}` +
      (boundaryEdges === null ? '' : `, ${countText(boundaryEdges)} boundary edges`) + (this.viewer.model.loading ? ' …' : '');
    if (this.shown.textContent !== text) this.shown.textContent = text;
  }

  /** The first tile tells what there is to show. */
  tilesChanged() {
    const { viewer } = this;
    const list = this.showChoices();
    if (list.length === this.shows.control.options.length) return;
    const first = viewer.look.show === 'plain' && viewer.model.hasColours && !this.chosen;
    this.chosen = true;
    this.shows.fill(list, first ? 'colour' : viewer.look.attribute ?? viewer.look.show);
    if (first) this.show('colour');
  }

  view() {
    const { viewer } = this;
    this.mode = choice('Move', [['orbit', 'Orbit'], ['fly', 'Fly']], 'orbit', (mode) => viewer.controls.setMode(mode));
    this.up = choice('Up', [['x', 'x'], ['y', 'y'], ['z', 'z']], viewer.controls.up, (axis) => viewer.controls.setUp(axis));
    this.theme = choice('Ground', [['dark', 'Dark'], ['light', 'Light']], 'dark', (theme) => viewer.setTheme(theme));
    this.speed = make('div', { className: 'value hint speed', textContent: '– frames a second' });
    viewer.stage.afterDraw.push(() => this.showSpeed());
    return section('View', this.mode.row, this.up.row, this.theme.row, this.speed,
      make('div', { className: 'buttons' },
        button('Fit', 'See all of it (F)', () => viewer.controls.home()),
        button('Picture', 'Save a PNG (P)', () => viewer.savePicture()),
        button('Keys', 'What the keys do (?)', () => this.help.toggle())));
  }

  showSpeed() {
    const { framesPerSecond: speed } = this.viewer.stage;
    if (speed) this.speed.textContent = `${speed.toFixed(speed < 10 ? 1 : 0)} frames a second`;
  }

  showPlace(place) {
    this.place.hidden = !place;
    if (!place) return;
    const { radius } = this.viewer.model;
    this.place.textContent = ['x', 'y', 'z'].map((axis) => `${axis} ${numberText(place[axis], 0.01 * radius)}`).join('   ');
  }

  showFacts() {
    const { description, model } = this.viewer;
    const lines = [];
    if (description.kind === 'mesh') {
      lines.push(`${countText(description.triangles)} triangles`, `${countText(description.vertices)} vertices`);
      const loops = description.boundaryLoops;
      lines.push(loops === 0 ? 'closed: no boundary'
        : `${countText(loops)} boundary ${loops === 1 ? 'loop' : 'loops'} of ${countText(description.boundaryEdges)} edges`);
    } else if (description.kind === 'points') {
      const { points, pointsThere } = description;
      lines.push(points < pointsThere ? `${countText(points)} of ${countText(pointsThere)} points` : `${countText(points)} points`);
    } else if (model.all.triangles) {
      const { triangles, tiles, levels } = model.all;
      lines.push(`${countText(triangles)} triangles`, `${countText(tiles)} tiles in ${levels} ${levels === 1 ? 'level' : 'levels'}`);
    }
    const size = ['x', 'y', 'z'].map((axis) => numberText(model.box.max[axis] - model.box.min[axis], model.radius));
    lines.push(size.join(' × '));
    const crs = description.crs ?? model.crs;
    if (crs) lines.push(crs);
    this.facts.replaceChildren(...lines.map((line) => make('div', { textContent: line })));
  }
}
