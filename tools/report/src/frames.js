// SPDX-License-Identifier: BSD-3-Clause
// Frames, one at a time: colour with keypoints, depth, masks.
import { data, decodeKeypoints } from './data.js';
import { el, layers, section } from './dom.js';
import { load, overlay, plane } from './pictures.js';
import { choose, on, state } from './state.js';
import { colour } from './theme.js';

const { frames } = data;
const masks = [
  { key: 'semantic', label: 'semantic', bit: 1, about: 'a priori, of a network or of files' },
  { key: 'geometric', label: 'geometric', bit: 2, about: 'what moves, by the geometry' },
  { key: 'fused', label: 'fused', bit: 4, about: 'what the run left out' },
  { key: 'true', label: 'truth', bit: 1, about: 'of the sequence' },
];
const shownOnColour = { keypoints: true, semantic: false, geometric: false, fused: true, true: false };

// From red (moves) over yellow to blue (static).
export function weightColour(weight) {
  const stops = [[255, 59, 48], [255, 176, 0], [63, 208, 255]];
  const x = Math.min(1, Math.max(0, weight)) * 2, i = Math.min(1, Math.floor(x));
  return `rgb(${stops[i].map((c, k) => Math.round(c + (stops[i + 1][k] - c) * (x - i))).join(' ')})`;
}

function tile(id, caption, wide) {
  const canvas = el('canvas', { id, width: frames.size[0], height: frames.size[1] });
  const text = el('figcaption', {}, caption);
  return { canvas, text, figure: el('figure', { className: wide ? 'wide' : '' }, canvas, text) };
}

function drawKeypoints(context, points) {
  const { width, height } = context.canvas;
  const radius = Math.max(1.6, width / 170);
  for (const point of [...points].reverse()) { // what moves comes first in the list, and on top here
    context.beginPath();
    context.arc(point.u * (width - 1), point.v * (height - 1), radius, 0, 7);
    context.fillStyle = weightColour(point.weight);
    context.strokeStyle = 'rgb(0 0 0 / 70%)';
    context.fill();
    context.stroke();
  }
}

function message(context, text) {
  context.fillStyle = colour('soft');
  context.font = `${Math.round(context.canvas.width / 18)}px system-ui, sans-serif`;
  context.textAlign = 'center';
  context.fillText(text, context.canvas.width / 2, context.canvas.height / 2);
}

const uses = (run, key) => ['true', 'fused', run.mode].includes(key) || run.mode === 'both';

// The planes of a frame's masks, none where nothing is known.
function planesOf(index) {
  const run = data.runs[state.run], { shown } = run;
  const own = shown.masks[index] && plane(shown.masks[index]);
  const parts = { fused: own, true: frames.truth[index] && plane(frames.truth[index]) };
  for (const key of shown.from === 'report' ? ['semantic', 'geometric'] : []) if (uses(run, key)) parts[key] = own;
  return parts;
}

function whyMissing(run, key) {
  if (key === 'true') return 'no truth';
  return uses(run, key) ? 'not recorded' : 'this run uses none';
}

async function draw(tiles, readout) {
  const index = state.frame, run = data.runs[state.run], { shown } = run;
  const [picture, depth] = await Promise.all([load(frames.colour[index]), load(frames.depth[index])]);
  if (index !== state.frame || run !== data.runs[state.run]) return; // the next one is on its way already
  const planes = planesOf(index);
  for (const [key, { canvas }] of Object.entries(tiles)) {
    const context = canvas.getContext('2d');
    context.clearRect(0, 0, canvas.width, canvas.height);
    const image = key === 'depth' ? depth : picture;
    if (!image) {
      message(context, 'could not be read');
      continue;
    }
    context.globalAlpha = masks.some((mask) => mask.key === key) ? 0.45 : 1;
    context.imageSmoothingEnabled = key !== 'depth';
    context.drawImage(image, 0, 0, canvas.width, canvas.height);
    context.globalAlpha = 1;
    const mask = masks.find((one) => one.key === key);
    if (mask && planes[key]) overlay(context, planes[key], mask.bit, colour(key), 0.75);
    else if (mask) message(context, whyMissing(run, key));
  }
  const context = tiles.colour.canvas.getContext('2d');
  for (const mask of masks) {
    if (shownOnColour[mask.key] && planes[mask.key]) overlay(context, planes[mask.key], mask.bit, colour(mask.key), 0.45);
  }
  const points = shown.keypoints[index] ? decodeKeypoints(shown.keypoints[index]) : null;
  if (shownOnColour.keypoints && points) drawKeypoints(context, points);
  tiles.colour.text.textContent = points
    ? `colour; ${points.length} keypoints, ${points.filter((p) => p.weight < run.tau).length} of them below ${run.tau}`
    : 'colour; no static weights: ' + (shown.from === 'report' ? 'the geometry was not asked' : 'run with --report');
  readout.textContent = `${index + 1}/${frames.t.length} · ${frames.t[index].toFixed(2)} s` +
    (shown.state?.[index] ? ` · ${shown.state[index]}, ${shown.inliers[index]} points of the map seen` +
      `${shown.keyframe[index] ? ', keyframe' : ''}` : '');
  readout.title = frames.stamp[index];
  document.getElementById('frames').dataset.drawn = String(index);
}

function player(slider) {
  const button = el('button', { type: 'button', id: 'play' }, 'play');
  let timer = null;
  const stop = () => {
    clearInterval(timer);
    timer = null;
    button.textContent = 'play';
  };
  button.addEventListener('click', () => {
    if (timer) return stop();
    if (state.frame === frames.t.length - 1) choose('frame', 0);
    const step = Math.max(33, 1000 * (frames.t.at(-1) - frames.t[0]) / Math.max(1, frames.t.length - 1));
    timer = setInterval(() => (state.frame < frames.t.length - 1 ? choose('frame', state.frame + 1) : stop()), step);
    button.textContent = 'stop';
  });
  slider.addEventListener('input', stop);
  return button;
}

export function scrubber() {
  const slider = el('input', { type: 'range', id: 'scrub', min: 0, max: frames.t.length - 1, value: 0, step: 1,
    'aria-label': 'frame' });
  slider.addEventListener('input', () => choose('frame', Number(slider.value)));
  const readout = el('output', { for: 'scrub' });
  const tiles = { colour: tile('view-colour', 'colour', true), depth: tile('view-depth', '', true) };
  tiles.depth.text.replaceChildren('depth ', `${frames.depth_range[0]} m`, el('span', { className: 'ramp depths' }),
    `${frames.depth_range[1]} m; black: none`);
  for (const mask of masks) tiles[mask.key] = tile(`view-${mask.key}`, `${mask.label}: ${mask.about}`, false);
  const redraw = () => {
    slider.value = state.frame;
    draw(tiles, readout);
  };
  on('frame', redraw);
  on('run', redraw);
  on('theme', redraw);
  const choice = layers([{ key: 'keypoints', label: 'keypoints', on: shownOnColour.keypoints },
    ...masks.map(({ key, label }) => ({ key, label, colour: `var(--${key})`, on: shownOnColour[key] }))], (key, shown) => {
    shownOnColour[key] = shown;
    redraw();
  });
  const weights = el('span', { className: 'small soft' }, 'static weight 0', el('span', { className: 'ramp weights' }), '1');
  const result = section('frames', 'Frames',
    el('div', { className: 'scrub' }, player(slider), slider, readout),
    el('div', { className: 'layers' }, el('span', { className: 'soft' }, 'on the colour picture:'), choice, weights),
    el('div', { className: 'tiles' }, Object.values(tiles).map((one) => one.figure)));
  requestAnimationFrame(redraw);
  return result;
}
