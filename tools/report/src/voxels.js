// SPDX-License-Identifier: BSD-3-Clause
// The voxel map of the chosen run, one layer per class.
import {
  BoxGeometry, Color, Float32BufferAttribute, Group, InstancedMesh, Matrix4, MeshBasicMaterial, SRGBColorSpace, Vector3,
} from 'three';
import { bytes, data } from './data.js';
import { el, layers, section } from './dom.js';
import { on, state } from './state.js';
import { stage3d } from './stage3d.js';
import { thickLine } from './thick_line.js';
import { runColour } from './theme.js';

const RECORD = 11; // bytes of a voxel

// A cube whose sides are lit unlike each other, so that it looks like one without lamps.
function cube() {
  const box = new BoxGeometry(1, 1, 1);
  const shades = [0.72, 0.72, 1.0, 1.0, 0.5, 0.5]; // +x -x +y -y +z -z
  const colours = [];
  for (let side = 0; side < 6; ++side) for (let k = 0; k < 12; ++k) colours.push(shades[side]);
  return box.setAttribute('color', new Float32BufferAttribute(colours, 3));
}

function mesh(map, label, count, records) {
  const result = new InstancedMesh(cube(), new MeshBasicMaterial({ vertexColors: true }), count);
  const matrix = new Matrix4(), tint = new Color();
  const low = new Vector3(...map.low);
  let next = 0;
  for (let at = 0; at + RECORD <= records.length; at += RECORD) {
    if (records[at + 7] !== label) continue;
    const size = 2 ** records[at + 6];
    const corner = [0, 2, 4].map((k) => records[at + k] | (records[at + k + 1] << 8));
    const edge = size * map.edge;
    matrix.makeScale(edge, edge, edge);
    matrix.setPosition(...corner.map((c, k) => low.getComponent(k) + (c + size / 2) * map.edge));
    result.setMatrixAt(next, matrix);
    tint.setRGB(records[at + 8] / 255, records[at + 9] / 255, records[at + 10] / 255, SRGBColorSpace);
    result.setColorAt(next++, tint);
  }
  return result;
}

function build(run) {
  const group = new Group(), records = bytes(run.map.voxels), byLabel = {};
  for (const one of run.map.classes) {
    byLabel[one.label] = mesh(run.map, one.label, one.count, records);
    group.add(byLabel[one.label]);
  }
  group.matrixAutoUpdate = false;
  group.matrix.fromArray(run.align); // the map's world beside the truth
  return { group, byLabel };
}

function dispose(group) {
  group.traverse((one) => {
    one.geometry?.dispose();
    one.material?.dispose();
  });
}

// Where the cells are, x y z of each, beside the truth.
function centres(group) {
  const points = [], matrix = new Matrix4(), at = new Vector3();
  for (const one of group.children) {
    for (let i = 0; i < one.count; ++i) {
      one.getMatrixAt(i, matrix);
      at.setFromMatrixPosition(matrix).applyMatrix4(group.matrix);
      points.push(at.x, at.y, at.z);
    }
  }
  return points;
}

export function voxels() {
  if (!data.runs.some((run) => run.map)) {
    return section('map', 'Map', el('p', { className: 'soft' }, 'The runs built no map (--no-map).'));
  }
  const stage = stage3d('Voxel map in 3D');
  const about = el('p', { className: 'small soft' }), toggles = el('div', { id: 'classes' });
  let shown = null, fitted = false;
  const show = () => {
    const run = data.runs[state.run];
    if (shown) {
      stage.scene.remove(shown.world);
      dispose(shown.world);
      shown = null;
    }
    toggles.replaceChildren();
    about.textContent = run.map
      ? `${run.map.count} occupied cells${run.map.of > run.map.count ? ` that stand for ${run.map.of}` : ''}, voxels of ` +
        `${run.map.edge} m. Cells of a class have its colour, all others the one that was seen.`
      : `${run.name} built no map.`;
    if (!run.map || !stage.scene) {
      stage.redraw?.();
      return;
    }
    const { group, byLabel } = build(run), line = thickLine(run.trajectory.p, 2.5), world = new Group();
    line.material.color = new Color(runColour(state.run));
    world.add(group, line);
    world.updateMatrixWorld(true);
    stage.scene.add(world);
    shown = { world };
    if (!fitted) stage.fit(centres(group), 0.9);
    fitted = true;
    toggles.append(layers([
      ...run.map.classes.map((one) => ({
        key: String(one.label), label: `${one.name} (${one.count})`, colour: `rgb(${one.colour.join(' ')})`,
      })), { key: 'path', label: 'trajectory' }], (key, visible) => {
      (key === 'path' ? line : byLabel[key]).visible = visible;
      stage.redraw();
    }));
    stage.redraw();
  };
  on('run', show);
  on('theme', show);
  show();
  return section('map', 'Semantic voxel map', about, stage.holder, toggles);
}
