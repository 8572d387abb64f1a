// SPDX-License-Identifier: BSD-3-Clause
// Trajectories in 3D, with keyframes, their graph, and the camera of the chosen frame.
import {
  BufferGeometry, Color, Float32BufferAttribute, Group, LineBasicMaterial, LineSegments, Matrix4, Points, PointsMaterial,
} from 'three';
import { data, indexAt } from './data.js';
import { el, layers } from './dom.js';
import { on, state } from './state.js';
import { stage3d } from './stage3d.js';
import { thickLine } from './thick_line.js';
import { colour, runColour, runVariable } from './theme.js';

function geometry(values) {
  return new BufferGeometry().setAttribute('position', new Float32BufferAttribute(values, 3));
}

const place = (node) => node.slice(2, 5);

function edges(graph, list) {
  return new LineSegments(geometry(list.flatMap(([a, b]) => [...place(graph.nodes[a]), ...place(graph.nodes[b])])),
    new LineBasicMaterial({ transparent: true }));
}

// Edges of a camera's view, of size 1.
function viewPyramid() {
  const { width, height } = data.sequence, x = 0.6, y = 0.6 * height / width;
  const corners = [[-x, -y, 1], [x, -y, 1], [x, y, 1], [-x, y, 1]];
  const lines = corners.flatMap((c, i) => [[0, 0, 0], c, c, corners[(i + 1) % 4]]);
  lines.push([-0.2 * x, -y, 1], [0, -1.4 * y, 1], [0, -1.4 * y, 1], [0.2 * x, -y, 1]); // which side is up
  return new LineSegments(geometry(lines.flat()), new LineBasicMaterial());
}

// Where a trajectory has the camera at its i-th pose; angles as the program took them apart: R = first Ry Rx Rz.
function poseMatrix(trajectory, i, scale) {
  const [pan, tilt, roll] = trajectory.a.slice(3 * i, 3 * i + 3).map((v) => v * Math.PI / 180);
  const f = data.view.first;
  const first = new Matrix4().set(f[0], f[1], f[2], 0, f[3], f[4], f[5], 0, f[6], f[7], f[8], 0, 0, 0, 0, 1);
  const turn = new Matrix4().makeRotationY(pan).multiply(new Matrix4().makeRotationX(tilt))
    .multiply(new Matrix4().makeRotationZ(roll));
  return new Matrix4().makeTranslation(...trajectory.p.slice(3 * i, 3 * i + 3)).multiply(first).multiply(turn)
    .multiply(new Matrix4().makeScale(scale, scale, scale));
}

function objects() {
  const all = {};
  if (data.truth) all.truth = thickLine(data.truth.p, 2, true);
  data.runs.forEach((run, i) => {
    all[`run${i}`] = thickLine(run.trajectory.p, 2.5);
  });
  for (const [key, make] of Object.entries({
    keyframes: (graph) => new Points(geometry(graph.nodes.flatMap(place)), new PointsMaterial({ size: 7, sizeAttenuation: false })),
    edges: (graph) => edges(graph, graph.edges),
    loops: (graph) => edges(graph, graph.loops),
  })) {
    all[key] = new Group();
    data.runs.forEach((run) => all[key].add(make(run.graph)));
    all[key].visible = key !== 'edges';
  }
  return all;
}

function paint(all, camera) {
  if (all.truth) all.truth.material.color = new Color(colour('truth'));
  data.runs.forEach((_, i) => {
    all[`run${i}`].material.color = new Color(runColour(i));
    all.keyframes.children[i].material.color = new Color(runColour(i));
    all.edges.children[i].material.color = new Color(runColour(i));
    all.edges.children[i].material.opacity = 0.35;
    all.loops.children[i].material.color = new Color(colour('loop'));
  });
  camera.material.color = new Color(colour('accent'));
}

export function paths3d() {
  const stage = stage3d('Trajectories in 3D');
  if (!stage.scene) return stage.holder;
  const all = objects(), camera = viewPyramid(), world = new Group();
  world.add(...Object.values(all));
  stage.scene.add(world);
  const radius = stage.fit([...(data.truth?.p ?? []), ...data.runs.flatMap((run) => run.trajectory.p)], 0.98);
  stage.scene.add(camera);
  camera.matrixAutoUpdate = false;

  const update = () => {
    ['keyframes', 'edges', 'loops'].forEach((key) => all[key].children.forEach((one, i) => {
      one.visible = i === state.run;
    }));
    const { trajectory } = data.runs[state.run];
    const i = indexAt(trajectory.t, data.frames.t[state.frame] ?? 0);
    camera.matrix.copy(poseMatrix(trajectory, i, 0.18 * radius));
    stage.redraw();
  };
  const theme = () => {
    paint(all, camera);
    stage.redraw();
  };
  on('run', update);
  on('frame', update);
  on('theme', theme);
  theme();
  update();
  const entries = [
    ...(data.truth ? [{ key: 'truth', label: 'ground truth', colour: 'var(--truth)' }] : []),
    ...data.runs.map((run, i) => ({ key: `run${i}`, label: run.name, colour: runVariable(i) })),
    { key: 'keyframes', label: 'keyframes' }, { key: 'edges', label: 'points in common', on: false },
    { key: 'loops', label: 'loops', colour: 'var(--loop)' },
  ];
  return el('div', { id: 'paths3d' }, stage.holder, layers(entries, (key, shown) => {
    all[key].visible = shown;
    stage.redraw();
  }));
}
