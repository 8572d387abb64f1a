// SPDX-License-Identifier: BSD-3-Clause
// The page, from top to bottom.
import { configuration } from './config.js';
import { curves } from './curves.js';
import { data } from './data.js';
import { el, section } from './dom.js';
import { scrubber } from './frames.js';
import { keyframes } from './graph.js';
import { paths3d } from './paths3d.js';
import { choose, on, state } from './state.js';
import { nameOf, tables } from './tables.js';
import { watchTheme } from './theme.js';
import { times } from './times.js';
import { voxels } from './voxels.js';

const places = [['errors', 'Errors'], ['trajectory', 'Trajectory'], ['frames', 'Frames'], ['times', 'Time'],
  ['graph', 'Keyframes'], ['map', 'Map'], ['config', 'Configuration']];

function head() {
  const { name, format, frames, seconds, camera, width, height } = data.sequence;
  document.title = `${name}: dynslam report`;
  return el('header', {}, el('h1', {}, name), el('p', { className: 'soft' },
    `${frames} frames in ${seconds.toFixed(1)} s, ${width} x ${height}, camera ${camera}, format ${format}; ` +
    `${data.runs.length === 1 ? 'one run' : `${data.runs.length} runs`}; dynslam ${data.version}`));
}

function picker() {
  if (data.runs.length < 2) return null;
  const buttons = data.runs.map((run, i) => {
    const button = el('button', { type: 'button', 'aria-pressed': String(i === state.run), dataset: { run: run.name } },
      nameOf(run, i));
    button.addEventListener('click', () => choose('run', i));
    return button;
  });
  on('run', () => buttons.forEach((button, i) => button.setAttribute('aria-pressed', String(i === state.run))));
  return el('div', { className: 'picker', role: 'group', 'aria-label': 'run that frames, times, graph and map show' }, buttons);
}

function thinned() {
  return el('details', { className: 'small soft' }, el('summary', {}, 'What was thinned to keep this file small'),
    el('ul', {}, data.thinned.map((line) => el('li', {}, line))));
}

// The run that shows most at first: the last one, which has all masks in an ablation.
state.run = data.runs.length - 1;
watchTheme();
document.getElementById('report').append(
  head(),
  el('div', { className: 'bar' }, el('nav', {}, places.map(([id, name]) => el('a', { href: `#${id}` }, name))), picker()),
  tables(), section('trajectory', 'Trajectory', paths3d(), curves()), scrubber(), times(), keyframes(), voxels(),
  configuration(), thinned());
document.addEventListener('keydown', (event) => {
  if (event.target !== document.body || event.ctrlKey || event.altKey || event.metaKey) return;
  const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
  if (step) choose('frame', Math.min(data.frames.t.length - 1, Math.max(0, state.frame + step)));
});
