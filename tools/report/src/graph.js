// SPDX-License-Identifier: BSD-3-Clause
// Keyframes, what holds them together, and the loops that were closed.
import { Vector3 } from 'three';
import { data } from './data.js';
import { el, flatCanvas, section, table } from './dom.js';
import { on, state } from './state.js';
import { up } from './stage3d.js';
import { colour, runColour } from './theme.js';

const graph = () => data.runs[state.run].graph;
const strongest = (edges) => Math.max(1, ...edges.map(([, , points]) => points));

function arc(context, a, b, y, room, span) {
  const height = room * Math.min(1, Math.sqrt(Math.abs(b - a) / Math.max(span, 1)));
  context.beginPath();
  context.moveTo(a, y);
  context.quadraticCurveTo((a + b) / 2, y - 2 * height, b, y);
  context.stroke();
}

function dots(context, points, radius) {
  context.fillStyle = runColour(state.run);
  for (const [x, y] of points) {
    context.beginPath();
    context.arc(x, y, radius, 0, 7);
    context.fill();
  }
}

// Over time: points in common above the line, loops below.
function drawArcs(context, width, height) {
  const { nodes, edges, loops } = graph();
  context.clearRect(0, 0, width, height);
  const end = Math.max(data.sequence.seconds, ...nodes.map((node) => node[1]), 1e-3), margin = 14;
  const xs = nodes.map((node) => margin + (width - 2 * margin) * Math.max(0, node[1]) / end);
  const y = loops.length > 0 ? 0.62 * height : height - 26;
  const most = strongest(edges);
  context.strokeStyle = runColour(state.run);
  for (const [a, b, points] of edges) {
    context.globalAlpha = 0.12 + 0.6 * points / most;
    arc(context, xs[a], xs[b], y, y - 10, width);
  }
  context.globalAlpha = 1;
  context.strokeStyle = colour('loop');
  context.lineWidth = 2;
  for (const [a, b] of loops) arc(context, xs[a], xs[b], y, -(height - y - 20), width);
  dots(context, xs.map((x) => [x, y]), 3);
  context.fillStyle = colour('soft');
  context.font = '12px system-ui, sans-serif';
  context.fillText('0 s', margin, height - 5);
  context.textAlign = 'right';
  context.fillText(`${end.toFixed(1)} s`, width - margin, height - 5);
}

// From above.
function drawPlan(context, width, height) {
  const { nodes, edges, loops } = graph();
  context.clearRect(0, 0, width, height);
  if (nodes.length === 0) return;
  const f = data.view.first, ahead = new Vector3(f[2], f[5], f[8]);
  const right = new Vector3().crossVectors(ahead, up).normalize(), front = new Vector3().crossVectors(up, right);
  const flat = nodes.map((node) => {
    const p = new Vector3(...node.slice(2, 5));
    return [p.dot(right), p.dot(front)];
  });
  const range = (k) => [Math.min(...flat.map((p) => p[k])), Math.max(...flat.map((p) => p[k]))];
  const [x0, x1] = range(0), [y0, y1] = range(1), margin = 24, foot = 20; // for the scale
  const scale = Math.min((width - 2 * margin) / Math.max(x1 - x0, 1e-3),
    (height - 2 * margin - foot) / Math.max(y1 - y0, 1e-3));
  const at = flat.map(([x, y]) =>
    [width / 2 + scale * (x - (x0 + x1) / 2), (height - foot) / 2 - scale * (y - (y0 + y1) / 2)]);
  const line = ([a, b]) => {
    context.beginPath();
    context.moveTo(...at[a]);
    context.lineTo(...at[b]);
    context.stroke();
  };
  const most = strongest(edges);
  context.strokeStyle = runColour(state.run);
  for (const edge of edges) {
    context.globalAlpha = 0.08 + 0.4 * edge[2] / most;
    line(edge);
  }
  context.globalAlpha = 1;
  context.strokeStyle = colour('loop');
  context.lineWidth = 2;
  loops.forEach(line);
  dots(context, at, 3.5);
  const bar = 10 ** Math.floor(Math.log10(width / 3 / scale));
  context.fillStyle = context.strokeStyle = colour('soft');
  context.lineWidth = 1.5;
  context.strokeRect(margin, height - 12, bar * scale, 0);
  context.font = '12px system-ui, sans-serif';
  context.fillText(`${bar >= 1 ? bar : bar.toPrecision(1)} m`, margin, height - 18);
}

function loopTable() {
  const { nodes, loops } = graph();
  if (loops.length === 0) return el('p', { className: 'small soft' }, 'No loop was closed.');
  return table('Loops', ['keyframe', 'sees again', 'after [s]', 'points that prove it'], loops.map(([a, b, points]) =>
    [String(nodes[a][0]), String(nodes[b][0]), Math.abs(nodes[a][1] - nodes[b][1]).toFixed(2), points]));
}

export function keyframes() {
  const over = flatCanvas('keyframes over time', 210, drawArcs), plan = flatCanvas('keyframes from above', 300, drawPlan);
  over.canvas.id = 'graph-time';
  plan.canvas.id = 'graph-plan';
  const about = el('p', { className: 'small soft' }), list = el('div', {});
  const update = () => {
    const { nodes, edges, loops, complete } = graph();
    about.textContent = complete
      ? `${nodes.length} keyframes, ${edges.length} pairs that share 15 points or more, ${loops.length} ${loops.length === 1 ? 'loop' : 'loops'}. ` +
        'Over time, points in common above the line and loops below; and from above.'
      : `${nodes.length} keyframes; what they share is recorded by runs with --report.`;
    list.replaceChildren(loopTable());
    over.redraw();
    plan.redraw();
  };
  on('run', update);
  on('theme', update);
  update();
  return section('graph', 'Keyframes and loops', about, over.canvas, el('div', { style: { height: '.8rem' } }), plan.canvas, list);
}
