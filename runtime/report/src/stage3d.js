// SPDX-License-Identifier: BSD-3-Clause
// A scene to turn, move and zoom. It draws when something has changed, not all the time.
import { Box3, Color, PerspectiveCamera, Scene, Sphere, Vector3, WebGLRenderer } from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import { data } from './data.js';
import { el } from './dom.js';
import { on } from './state.js';
import { colour } from './theme.js';

export const up = new Vector3(...data.view.up);

function renderer(holder) {
  const canvas = el('canvas');
  // Asked first, since three.js tells a browser without WebGL as an error of the page.
  const context = canvas.getContext('webgl2', { antialias: true });
  if (!context) {
    holder.append(el('p', { className: 'message soft' }, 'This browser has no WebGL, which draws scenes in 3D.'));
    return null;
  }
  holder.append(canvas);
  const made = new WebGLRenderer({ canvas, context, antialias: true });
  made.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
  return made;
}

// A holder with a scene. `fit(object)` looks at all of an object; null where there is no WebGL.
export function stage3d(label) {
  const holder = el('div', { className: 'stage3d', role: 'img', 'aria-label': label });
  const gl = renderer(holder);
  if (!gl) return { holder, scene: null };
  const scene = new Scene();
  const camera = new PerspectiveCamera(45, 1, 0.01, 1000);
  camera.up.copy(up);
  const controls = new OrbitControls(camera, gl.domElement);
  let asked = false;
  const redraw = () => {
    if (asked) return;
    asked = true;
    requestAnimationFrame(() => {
      asked = false;
      gl.render(scene, camera);
    });
  };
  controls.addEventListener('change', redraw);
  const size = () => {
    const { clientWidth: width, clientHeight: height } = holder;
    if (width === 0) return;
    gl.setSize(width, height, false);
    camera.aspect = width / height;
    camera.updateProjectionMatrix();
    redraw();
  };
  new ResizeObserver(size).observe(holder);
  const theme = () => {
    scene.background = new Color(colour('canvas'));
    redraw();
  };
  on('theme', theme);
  theme();
  // From behind the first camera and above, at a distance from which all is seen.
  const fit = (object, back = 1.3) => {
    const sphere = new Box3().setFromObject(object).getBoundingSphere(new Sphere());
    const radius = Math.max(sphere.radius, 0.05);
    const [, , fx, , , fy, , , fz] = data.view.first;
    const forward = new Vector3(fx, fy, fz).addScaledVector(up, -new Vector3(fx, fy, fz).dot(up));
    if (forward.length() < 0.1) forward.set(up.y, up.z, up.x).cross(up);
    const from = forward.normalize().negate().addScaledVector(up, 0.6)
      .addScaledVector(new Vector3().crossVectors(forward, up), 0.35).normalize();
    camera.position.copy(sphere.center).addScaledVector(from, back * radius / Math.sin(Math.PI / 8));
    camera.near = radius / 200;
    camera.far = radius * 60;
    camera.updateProjectionMatrix();
    controls.target.copy(sphere.center);
    controls.update();
    redraw();
  };
  return { holder, scene, redraw, fit, camera, canvas: gl.domElement };
}
