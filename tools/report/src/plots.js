// SPDX-License-Identifier: BSD-3-Clause
// Line plots over time.
import uPlot from 'uplot';
import { colour } from './theme.js';
import { on } from './state.js';
import { el } from './dom.js';

const GAP = 0.5; // seconds without a value that interrupt a line

// Values with a hole where there are none for long.
export function withGaps(t, values) {
  const times = [], result = [];
  for (let i = 0; i < t.length; ++i) {
    if (i > 0 && t[i] - t[i - 1] > GAP) {
      times.push((t[i] + t[i - 1]) / 2);
      result.push(null);
    }
    times.push(t[i]);
    result.push(values[i]);
  }
  return [times, result];
}

const powers = (_, __, low, high) => {
  const all = [];
  for (let k = Math.ceil(Math.log10(low) - 1e-6); k <= Math.log10(high) + 1e-6; ++k) all.push(10 ** k);
  return all;
};

function axes(unit, log) {
  const style = { stroke: colour('soft'), grid: { stroke: colour('line'), width: 1 }, ticks: { stroke: colour('line') } };
  return [{ ...style, label: 'time [s]', labelSize: 18, size: 34 }, {
    ...style, label: unit, labelSize: 18, size: 58,
    ...(log ? { splits: powers, values: (_, at) => at.map((v) => (v === null ? '' : String(Number(v.toPrecision(1))))) } : {}),
  }];
}

// A plot that follows its element's width and the scheme. make() gives {title, unit, height, series, data, log, sync}
// anew for each drawing; chosen(t) is called with the time of a click.
export function plot(make, chosen) {
  const holder = el('div', { className: 'plot' });
  let drawn = null;
  const draw = () => {
    const width = holder.clientWidth;
    if (width === 0) return;
    drawn?.destroy();
    const { title, unit, height = 190, series, data, log = false, sync = null, legend = true } = make();
    drawn = new uPlot({
      title, width, height,
      series: [{ label: 't [s]', value: (_, v) => (v === null || v === undefined ? '' : v.toFixed(2)) }, ...series],
      axes: axes(unit, log),
      scales: { x: { time: false }, y: log ? { distr: 3 } : {} },
      legend: { show: legend },
      cursor: { drag: { x: true, y: false }, ...(sync ? { sync: { key: sync } } : {}) },
    }, data, holder);
    drawn.over.addEventListener('click', () => {
      const at = drawn.cursor.left;
      if (chosen && at >= 0) chosen(drawn.posToVal(at, 'x'));
    });
  };
  let width = 0;
  new ResizeObserver(() => {
    if (Math.abs(holder.clientWidth - width) < 2) return;
    width = holder.clientWidth;
    if (drawn) drawn.setSize({ width, height: drawn.height });
    else draw();
  }).observe(holder);
  on('theme', draw);
  return { holder, draw };
}

// Curves of unlike times as one table.
export function joined(curves) {
  return uPlot.join(curves.map(([t, values]) => withGaps(t, values)));
}

export const digits = (count) => (_, v) => (v === null || v === undefined ? '–' : v.toFixed(count));
