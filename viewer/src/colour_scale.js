// Values as colours: the ramps, and what range of values they span.
import { DataTexture, LinearFilter, RGBAFormat, SRGBColorSpace, UnsignedByteType } from 'three';

/** Colours at equal distances, dark to bright or from one end to the other. */
export const ramps = {
  Viridis: ['#440154', '#472d7b', '#3b528b', '#2c728e', '#21918c', '#28ae80', '#5ec962', '#addc30', '#fde725'],
  Turbo: ['#30123b', '#4662d7', '#35abf8', '#1ae4b6', '#72fe5e', '#c8ef34', '#faba39', '#f66b19', '#ca2a04', '#7a0403'],
  'Blue to red': ['#2166ac', '#67a9cf', '#d1e5f0', '#f7f7f7', '#fddbc7', '#ef8a62', '#b2182b'],
  Grey: ['#101010', '#f4f4f4'],
};

function channels(colour) {
  return [1, 3, 5].map((at) => parseInt(colour.slice(at, at + 2), 16));
}

export function rampTexture(name) {
  const stops = ramps[name].map(channels);
  const steps = 256;
  const texels = new Uint8Array(4 * steps);
  for (let i = 0; i < steps; ++i) {
    const at = (i / (steps - 1)) * (stops.length - 1);
    const stop = Math.min(Math.floor(at), stops.length - 2);
    for (let k = 0; k < 3; ++k) {
      texels[4 * i + k] = Math.round(stops[stop][k] + (at - stop) * (stops[stop + 1][k] - stops[stop][k]));
    }
    texels[4 * i + 3] = 255;
  }
  const texture = new DataTexture(texels, steps, 1, RGBAFormat, UnsignedByteType);
  texture.colorSpace = SRGBColorSpace;
  texture.minFilter = texture.magFilter = LinearFilter;
  texture.needsUpdate = true;
  return texture;
}

export function rampGradient(name) {
  return `linear-gradient(to right, ${ramps[name].join(', ')})`;
}

const mostValues = 500000;

/** Sorted values of an attribute over all geometries, at most half a million of them, taken evenly. */
export function sortedValues(geometries, name) {
  const attributes = geometries.map((geometry) => geometry.getAttribute(name)).filter(Boolean);
  const count = attributes.reduce((sum, attribute) => sum + attribute.count, 0);
  const step = Math.max(1, Math.ceil(count / mostValues));
  const values = new Float32Array(Math.ceil(count / step) + attributes.length);
  let kept = 0;
  for (const attribute of attributes) {
    for (let i = 0; i < attribute.count; i += step) values[kept++] = attribute.getX(i);
  }
  return values.subarray(0, kept).sort();
}

/** The range that leaves `percent` of the values out at either end. */
export function clampedRange(sorted, percent) {
  if (sorted.length === 0) return [0, 1];
  const last = sorted.length - 1;
  const cut = Math.floor((percent / 100) * last);
  return [sorted[cut], sorted[last - cut]];
}

/** As many digits as tell values in a range apart. */
export function numberText(value, span) {
  if (!Number.isFinite(value)) return String(value);
  const digits = Math.max(0, Math.min(9, 3 - Math.floor(Math.log10(Math.max(span, 1e-12)))));
  if (Math.abs(value) >= 1e9 || (value !== 0 && Math.abs(value) < 1e-6)) return value.toExponential(4);
  const text = value.toFixed(digits);
  return Number(text) === 0 ? text.replace('-', '') : text;
}

export function countText(count) {
  return count.toLocaleString('en').replaceAll(',', '\u202f');
}
