// What lies under a pixel: the scene drawn once more, into a single texel that holds places instead of colours. Knows
// every drawable alike, what is cut away included, and needs no tree of the triangles.
import { Color, DoubleSide, FloatType, NearestFilter, NoBlending, ShaderMaterial, Vector3, WebGLRenderTarget } from 'three';
import { shared } from './surface_material.js';

function placeMaterial(points) {
  return new ShaderMaterial({
    vertexShader: `#include <clipping_planes_pars_vertex>
      uniform float pointLength;
      uniform float pixelScale;
      varying vec3 place;
      void main() {
        vec4 mvPosition = modelViewMatrix * vec4(position, 1.0);
        place = (modelMatrix * vec4(position, 1.0)).xyz;
        gl_Position = projectionMatrix * mvPosition;
        ${points ? 'gl_PointSize = clamp(pointLength * pixelScale / max(-mvPosition.z, 1e-9), 9.0, 96.0);' : ''}
        #include <clipping_planes_vertex>
      }`,
    fragmentShader: `#include <clipping_planes_pars_fragment>
      varying vec3 place;
      void main() {
        #include <clipping_planes_fragment>
        gl_FragColor = vec4(place, 1.0);
      }`,
    uniforms: shared,
    side: DoubleSide,
    clipping: true,
    blending: NoBlending,
  });
}

export class Picker {
  constructor(stage) {
    this.stage = stage;
    this.target = new WebGLRenderTarget(1, 1, { type: FloatType, minFilter: NearestFilter, magFilter: NearestFilter });
    this.surface = placeMaterial(false);
    this.points = placeMaterial(true);
  }

  /** The place in the scene under a pixel of the window, or nothing. */
  at(x, y, group) {
    const { renderer, camera, scene } = this.stage;
    this.stage.adjustDepth();
    const { fullWidth, fullHeight, offsetX, offsetY } = camera.view;
    camera.setViewOffset(fullWidth, fullHeight, Math.floor(x) + offsetX, Math.floor(y) + offsetY, 1, 1);
    const restore = this.exchangeMaterials(scene, group);
    const { background } = scene;
    scene.background = null;
    const clear = renderer.getClearColor(new Color()), alpha = renderer.getClearAlpha();
    renderer.setClearColor(0, 0);
    renderer.setRenderTarget(this.target);
    renderer.clear();
    renderer.render(scene, camera);
    const texel = new Float32Array(4);
    renderer.readRenderTargetPixels(this.target, 0, 0, 1, 1, texel);
    renderer.setRenderTarget(null);
    renderer.setClearColor(clear, alpha);
    scene.background = background;
    restore();
    this.stage.centre();
    return texel[3] > 0 ? new Vector3(texel[0], texel[1], texel[2]) : null;
  }

  exchangeMaterials(scene, group) {
    const undo = [];
    scene.traverse((object) => {
      if (object.userData.isOverlay) {
        const { visible } = object;
        undo.push(() => (object.visible = visible));
        object.visible = false;
      }
    });
    group.traverse((object) => {
      if (!(object.isMesh || object.isPoints) || object.userData.isOverlay) return;
      const { material } = object;
      undo.push(() => (object.material = material));
      object.material = object.isPoints ? this.points : this.surface;
    });
    return () => undo.forEach((step) => step());
  }
}
