// The picture that is saved: the canvas, with what the page lays over it, a measured distance and the scale of colours.
import { numberText, ramps } from './colour_scale.js';

const inks = { dark: '#e8eaed', light: '#202328' };

/** Of the canvas as it has just been drawn. */
export function composePicture(viewer) {
  const { canvas } = viewer.stage;
  const picture = document.createElement('canvas');
  picture.width = canvas.width;
  picture.height = canvas.height;
  const context = picture.getContext('2d');
  context.drawImage(canvas, 0, 0);
  const ratio = canvas.width / window.innerWidth;
  context.scale(ratio, ratio);
  context.font = '13px system-ui, sans-serif';
  context.textBaseline = 'middle';
  drawDistance(context, viewer.measure);
  if (viewer.look.attribute) drawScale(context, viewer);
  return new Promise((resolve) => picture.toBlob(resolve, 'image/png'));
}

function drawDistance(context, measure) {
  context.strokeStyle = '#ffb020';
  context.lineWidth = 2;
  for (const { x, y } of measure.marksOnScreen()) {
    context.beginPath();
    context.arc(x, y, 5, 0, 2 * Math.PI);
    context.stroke();
  }
  const at = measure.labelOnScreen();
  if (!at) return;
  const text = measure.label.textContent;
  const width = context.measureText(text).width + 14;
  context.fillStyle = '#ffb020';
  context.beginPath();
  context.roundRect(at.x - width / 2, at.y - 11, width, 22, 5);
  context.fill();
  context.fillStyle = '#1b1400';
  context.textAlign = 'center';
  context.fillText(text, at.x, at.y);
}

/** At the lower left: the attribute's name over the ramp, its ends' values under it. */
function drawScale(context, { look, model, range, scale }) {
  const left = 24, width = 240, bottom = window.innerHeight - 24;
  const stops = ramps[scale.ramp];
  const gradient = context.createLinearGradient(left, 0, left + width, 0);
  stops.forEach((colour, k) => gradient.addColorStop(k / (stops.length - 1), colour));
  context.fillStyle = gradient;
  context.fillRect(left, bottom - 32, width, 12);
  context.fillStyle = inks[document.documentElement.dataset.theme] ?? inks.dark;
  const span = range[1] - range[0] || Math.abs(range[0]) || 1;
  context.textAlign = 'left';
  context.fillText(model.attributes.get(look.attribute), left, bottom - 44);
  context.fillText(numberText(range[0], span), left, bottom - 8);
  context.textAlign = 'right';
  context.fillText(numberText(range[1], span), left + width, bottom - 8);
}
