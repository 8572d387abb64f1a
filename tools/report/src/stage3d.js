// SPDX-License-Identifier: BSD-3-Clause
// A scene to turn, move and zoom. It draws when something has changed, not all the time.
import { Color, PerspectiveCamera, Scene, Vector3, WebGLRenderer } from 'three';
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

// Centre of points (x y z of each), and the distance within which a share of them lies.
function extent(points, share) {
  const centre = new Vector3(), count = points.length / 3;
  for (let i = 0; i < points.length; ++i) {
    centre.setComponent(i % 3, centre.getComponent(i % 3) + points[i] / count);
  }
  const distances = [];
  for (let i = 0; i < points.length; i += 3) {
    distances.push(Math.hypot(points[i] - centre.x, points[i + 1] - centre.y, points[i + 2] - centre.z));
  }
  distances.sort((a, b) => a - b);
  return { centre, radius: Math.max(0.05, distances[Math.floor(share * (distances.length - 1))] ?? 1) };
}

// A holder with a scene, which is null where there is no WebGL. `fit(points, share)` looks at a share of points (x y z of
// each) and returns their radius.
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
  // From behind the first camera and above, at a distance from which all is seen.
  let looked = null;
  const look = () => {
    const { centre, radius } = looked, [, , fx, , , fy, , , fz] = data.view.first;
    const ahead = new Vector3(fx, fy, fz), forward = ahead.clone().addScaledVector(up, -ahead.dot(up));
    if (forward.length() < 0.1) forward.set(up.y, up.z, up.x).cross(up); // it looks up or down
    const from = forward.normalize().clone().negate().addScaledVector(up, 0.6)
      .addScaledVector(new Vector3().crossVectors(forward, up), -0.35).normalize();
    const distance = 0.95 * radius / Math.sin(Math.PI / 8) / Math.min(1, camera.aspect);
    camera.position.copy(centre).addScaledVector(from, distance);
    camera.near = radius / 200;
    camera.far = radius * 60;
    camera.updateProjectionMatrix();
    controls.target.copy(centre);
    controls.update();
    redraw();
  };
  const fit = (points, share) => {
    looked = extent(points, share);
    look();
    return looked.radius;
  };
  let sized = false;
  const size = () => {
    const { clientWidth: width, clientHeight: height } = holder;
    if (width === 0) return;
    gl.setSize(width, height, false);
    camera.aspect = width / height;
    camera.updateProjectionMatrix();
    if (!sized && looked) look();
    sized = true;
    redraw();
  };
  new ResizeObserver(size).observe(holder);
  const theme = () => {
    scene.background = new Color(colour('canvas'));
    redraw();
  };
  on('theme', theme);
  theme();
  return { holder, scene, redraw, fit, camera, canvas: gl.domElement };
}
