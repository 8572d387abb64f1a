// SPDX-License-Identifier: BSD-3-Clause
// Position, angles and errors over time, of all runs beside the truth.
import { data, indexAt } from './data.js';
import { choose } from './state.js';
import { colour, runColour } from './theme.js';
import { el } from './dom.js';
import { digits, joined, plot } from './plots.js';

const every = (list, offset) => list.filter((_, i) => i % 3 === offset);

function series(runs, places, truth) {
  const lines = runs.map((run) => ({
    label: run.name, stroke: runColour(data.runs.indexOf(run)), width: 1.5, points: { show: false }, value: digits(places),
  }));
  return truth ? [{ label: 'truth', stroke: colour('truth'), width: 1.2, dash: [5, 4], points: { show: false },
    value: digits(places) }, ...lines] : lines;
}

const atTime = (t) => choose('frame', indexAt(data.frames.t, t));

function curve(title, unit, places, values) {
  return plot(() => ({
    title, unit, sync: 'time', series: series(data.runs, places, data.truth),
    data: joined([...(data.truth ? [[data.truth.t, values(data.truth)]] : []),
      ...data.runs.map((run) => [run.trajectory.t, values(run.trajectory)])]),
  }), atTime).holder;
}

function error(title, unit, places, key) {
  const runs = data.runs.filter((run) => run.error);
  const tiny = 10 ** -(places + 1);
  return plot(() => ({
    title, unit, sync: 'time', log: true, series: series(runs, places, false),
    data: joined(runs.map((run) => [run.error.t, run.error[key].map((v) => Math.max(v, tiny))])),
  }), atTime).holder;
}

export function curves() {
  const axes = ['x', 'y', 'z'].map((name, i) => curve(name, 'm', 3, (list) => every(list.p, i)));
  const angles = ['pan', 'tilt', 'roll'].map((name, i) => curve(name, 'deg', 2, (list) => every(list.a, i)));
  const errors = data.runs.some((run) => run.error)
    ? [error('position error', 'm', 4, 'e'), error('rotation error', 'deg', 3, 'r')] : [];
  const frame = data.truth && data.runs.some((run) => run.aligned)
    ? 'Runs are moved as a whole to where they fit the truth best (as for the ATE); rotation errors are those that are left.'
    : 'Without ground truth to align with, the world is that of the first camera.';
  return [
    el('p', { className: 'small soft' }, `${frame} Angles are the camera's beside its first one: pan to the side, tilt up ` +
      'and down, roll about the view. A click in a plot shows that frame below; dragging zooms, a double click takes it back.'),
    el('div', { className: 'grid', id: 'curves' }, ...errors, ...[0, 1, 2].flatMap((i) => [axes[i], angles[i]])),
  ];
}
