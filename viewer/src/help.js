// What keys and the mouse do.
import { button, make } from './dom.js';

const lines = [
  ['Drag', 'orbit; while flying, look around'],
  ['Right drag, Shift drag', 'move sideways'],
  ['Wheel', 'nearer and farther, towards the pointer'],
  ['Click', 'tell the place'],
  ['Double click', 'orbit around the place'],
  ['W A S D, arrows', 'forwards, left, back, right'],
  ['Q  E', 'down, up'],
  ['O', 'orbit or fly'],
  ['F', 'see all of it'],
  ['1  2  3', 'from the front, from the right, from above'],
  ['C  N', 'colours, normals'],
  ['G', 'smooth or flat'],
  ['L', 'edges'],
  ['B', 'boundary loops'],
  ['X', 'clipping plane: next axis'],
  ['M', 'measure a distance'],
  ['+  −', 'point size'],
  ['P', 'save a picture'],
  ['T', 'dark or light'],
  ['H', 'fold the panel'],
  ['?', 'this list'],
];

export class Help {
  constructor() {
    const list = make('dl', {}, ...lines.flatMap(([keys, text]) => [
      make('dt', { textContent: keys }), make('dd', { textContent: text }),
    ]));
    this.dialog = make('dialog', { className: 'help', ariaLabel: 'Keys' },
      make('h2', { textContent: 'Keys and mouse' }), list, button('Close', 'Esc', () => this.dialog.close()));
    this.dialog.onclick = (event) => (event.target === this.dialog ? this.dialog.close() : null);
  }

  toggle() {
    if (this.dialog.open) this.dialog.close();
    else this.dialog.showModal();
  }
}
