// SPDX-License-Identifier: BSD-3-Clause
// Where the time goes: stages of each frame, and their p50 and p95.
import { data, indexAt } from './data.js';
import { el, section, swatch, table } from './dom.js';
import { plot } from './plots.js';
import { choose, on, state } from './state.js';
import { nameOf } from './tables.js';
import { colour, stageColours } from './theme.js';

// On the tracking thread, one after the other; the rest runs beside them.
const stacked = ['initial_pose', 'local_map', 'lucas_kanade', 'residuals', 'free_space', 'growing', 'pose', 'keyframe'];
const beside = ['features', 'network', 'mask_keeper'];
const whole = ['tracking', 'frame', 'latency'];
const words = (name) => name.replaceAll('_', ' ');

const column = (times, name) => times.cells[times.columns.indexOf(name)];
const used = (times, name) => times.columns.includes(name) && column(times, name).some((v) => v > 0);

function timeline() {
  const { times } = data.runs[state.run];
  const parts = stacked.filter((name) => used(times, name));
  const sums = [];
  parts.forEach((name, i) => {
    sums.push(column(times, name).map((v, k) => (v ?? 0) + (i > 0 ? sums[i - 1][k] : 0)));
  });
  const area = (name, i) => ({
    label: words(name), fill: stageColours[name], stroke: stageColours[name], width: 0.5, points: { show: false },
    value: (_, __, ___, at) => (at === null ? '–' : `${(column(times, name)[at] ?? 0).toFixed(2)}`),
    data: sums[i],
  });
  const line = (name, stroke, dash) => ({
    label: words(name), stroke, width: 1, dash, points: { show: false }, data: column(times, name),
    value: (_, v) => (v === null || v === undefined ? '–' : v.toFixed(2)),
  });
  // The highest sum first: the lower ones are drawn over it.
  const series = [...parts.map(area).reverse(),
    ...beside.filter((name) => used(times, name)).map((name) => line(name, stageColours[name], [4, 3])),
    ...whole.filter((name) => used(times, name)).map((name) =>
      line(name, colour(name === 'tracking' ? 'ink' : 'soft'), name === 'tracking' ? undefined : [2, 3]))];
  const shown = ['frame', 'latency'];
  return {
    title: '', unit: 'ms', height: 300, data: [times.t, ...series.map((one) => one.data)],
    series: series.map(({ data: _, ...one }) => ({ ...one, show: !shown.includes(one.label) })),
  };
}

function percentiles() {
  const names = [...stacked, ...beside, ...whole].filter((name) => data.runs.some((run) => used(run.times, name)));
  const longest = Math.max(1e-3, ...names.map((name) => data.runs[state.run].times.stages[name]?.[1] ?? 0));
  const rows = names.map((name) => [
    el('span', {}, swatch(stageColours[name] ?? 'var(--soft)'), words(name)),
    ...data.runs.flatMap((run) => (run.times.stages[name] ?? [null, null]).map((v) => v?.toFixed(2))),
    bars(data.runs[state.run].times.stages[name] ?? [0, 0], longest, stageColours[name] ?? 'var(--soft)'),
  ]);
  const result = table('', ['stage [ms]', ...data.runs.flatMap((run) => [`${run.name} p50`, 'p95']), ''], rows);
  result.id = 'stages';
  return result;
}

function bars([p50, p95], longest, fill) {
  const width = (value) => `${Math.max(0, 140 * (value ?? 0) / longest)}px`;
  return el('span', { style: { display: 'inline-block', width: '145px', textAlign: 'left' }, title: 'p50 full, p95 pale' },
    el('span', { className: 'meter', style: { background: fill, width: width(p50) } }),
    el('span', { className: 'meter', style: { background: fill, opacity: 0.4, width: width((p95 ?? 0) - (p50 ?? 0)) } }));
}

function sizes() {
  const { times } = data.runs[state.run];
  const points = { label: 'points', stroke: colour('accent'), width: 1.5, points: { show: false },
    value: (_, v) => (v === null || v === undefined ? '–' : String(v)) };
  return {
    title: 'points of the map', unit: '', height: 220, series: [points],
    data: [times.t, column(times, 'points') ?? []],
  };
}

export function times() {
  const chosen = (t) => choose('frame', indexAt(data.frames.t, t));
  const line = plot(timeline, chosen), points = plot(sizes, chosen);
  const holder = el('div', {}, percentiles()), who = el('p', { className: 'small soft' });
  const update = () => {
    who.replaceChildren('Stages of each frame of ', nameOf(data.runs[state.run], state.run),
      ': those of the tracking thread stand on each other, those of other threads are lines.');
    holder.replaceChildren(percentiles());
    line.draw();
    points.draw();
  };
  on('run', update);
  update();
  return section('times', 'Time', who, line.holder,
    el('div', { className: data.runs.length > 2 ? '' : 'grid' }, holder, points.holder));
}
