// How surfaces and points look: one shader for both, whose parts are chosen by what there is and what is asked for.
import { Color, DoubleSide, ShaderMaterial, Vector2 } from 'three';

const vertexShader = /* glsl */ `
#include <clipping_planes_pars_vertex>
#ifdef HAS_COLOUR
attribute vec3 color;
#endif
#ifdef HAS_VALUE
attribute float value;
#endif
uniform float pointLength;
uniform float pixelScale;
varying vec3 vNormal;
varying vec3 vView;
varying vec3 vColour;
varying float vValue;

void main() {
  vec4 mvPosition = modelViewMatrix * vec4(position, 1.0);
  vView = -mvPosition.xyz;
#ifdef HAS_NORMAL
  vNormal = normalMatrix * normal;
#endif
#ifdef HAS_COLOUR
  vColour = color;
#endif
#ifdef HAS_VALUE
  vValue = value;
#endif
  gl_Position = projectionMatrix * mvPosition;
#ifdef POINTS
  gl_PointSize = clamp(pointLength * pixelScale / max(-mvPosition.z, 1e-9), 1.0, 96.0);
#endif
  #include <clipping_planes_vertex>
}
`;

const fragmentShader = /* glsl */ `
#include <clipping_planes_pars_fragment>
uniform vec3 plain;
uniform sampler2D ramp;
uniform vec2 range;
uniform float lit;
varying vec3 vNormal;
varying vec3 vView;
varying vec3 vColour;
varying float vValue;

vec3 encoded(vec3 c) {
  return mix(1.055 * pow(max(c, vec3(0.0)), vec3(1.0 / 2.4)) - 0.055, 12.92 * c, lessThanEqual(c, vec3(0.0031308)));
}

void main() {
  #include <clipping_planes_fragment>
#ifdef POINTS
  vec2 offset = 2.0 * gl_PointCoord - 1.0;
  if (dot(offset, offset) > 1.0) discard;
#endif
  vec3 view = normalize(vView);
  // What the surface calls outside; points without normals face the viewer.
#if defined(FLAT) && !defined(POINTS)
  vec3 outside = normalize(cross(dFdx(vView), dFdy(vView)));
  if (!gl_FrontFacing) outside = -outside;
#elif defined(HAS_NORMAL)
  vec3 outside = normalize(vNormal);
#else
  vec3 outside = view;
#endif
#ifdef POINTS
  bool back = dot(outside, view) < 0.0;
#else
  bool back = !gl_FrontFacing;
#endif
  // Lit from the side it is seen from: the triangle's, since where a surface is seen at an angle its smooth normal may
  // point away already.
#if defined(POINTS)
  vec3 seen = view;
#else
  vec3 seen = cross(dFdx(vView), dFdy(vView));
  if (dot(seen, view) < 0.0) seen = -seen;
#endif
  vec3 n = dot(outside, seen) < 0.0 ? -outside : outside;

  vec3 albedo = plain;
#if defined(SHOW_COLOUR) && defined(HAS_COLOUR)
  albedo = vColour;
#elif defined(SHOW_VALUE) && defined(HAS_VALUE)
  float at = clamp((vValue - range.x) / max(range.y - range.x, 1e-30), 0.0, 1.0);
  albedo = texture2D(ramp, vec2(at * 255.0 / 256.0 + 0.5 / 256.0, 0.5)).rgb;
#elif defined(SHOW_NORMAL)
  albedo = pow(0.5 + 0.5 * outside * mat3(viewMatrix), vec3(2.2));
#endif
#ifndef SHOW_NORMAL
  if (back) albedo = mix(albedo, vec3(0.08, 0.20, 0.55), 0.55);
#endif
  float key = max(dot(n, normalize(vec3(-0.35, 0.45, 0.85))), 0.0);
  float fill = 0.5 + 0.5 * n.y;
  float rim = pow(1.0 - max(dot(n, view), 0.0), 3.0);
  vec3 light = vec3(0.20, 0.21, 0.23) * (0.55 + 0.9 * fill) + vec3(0.80, 0.78, 0.75) * key + 0.06 * rim;
#if defined(POINTS) && !defined(HAS_NORMAL)
  light = vec3(1.0);
#endif
  gl_FragColor = vec4(encoded(albedo * mix(vec3(1.0), light, lit)), 1.0);
}
`;

/** Values all materials share, so that a change is one change. */
export const shared = {
  plain: { value: new Color('#c9c4ba') },
  ramp: { value: null },
  range: { value: new Vector2(0, 1) },
  lit: { value: 1 },
  pointLength: { value: 0.01 },
  pixelScale: { value: 1 },
};

const shows = { colour: 'SHOW_COLOUR', value: 'SHOW_VALUE', normal: 'SHOW_NORMAL' };

/** `look`: { show: plain|colour|normal|value, flat }. */
export function makeMaterial(geometry, points, look) {
  const defines = {};
  if (points) defines.POINTS = '';
  if (geometry.hasAttribute('normal')) defines.HAS_NORMAL = '';
  if (geometry.hasAttribute('color')) defines.HAS_COLOUR = '';
  if (look.show === 'value' && geometry.hasAttribute('value')) defines.HAS_VALUE = '';
  if (look.flat) defines.FLAT = '';
  if (shows[look.show]) defines[shows[look.show]] = '';
  return new ShaderMaterial({
    vertexShader,
    fragmentShader,
    defines,
    uniforms: shared,
    side: DoubleSide,
    clipping: true,
    polygonOffset: !points,
    polygonOffsetFactor: 1,
    polygonOffsetUnits: 1,
  });
}
