// SPDX-License-Identifier: BSD-3-Clause
// Errors of all runs, and how they went.
import { data } from './data.js';
import { el, section, swatch, table } from './dom.js';
import { runVariable } from './theme.js';

const measures = [
  ['ate_m', 'Absolute trajectory error [m]', 4],
  ['rpe_trans_m', 'Relative pose error over 1 s, translation [m]', 4],
  ['rpe_rot_deg', 'Relative pose error over 1 s, rotation [deg]', 3],
];
const figures = [['rmse', 'RMSE'], ['mean', 'mean'], ['median', 'median'], ['std', 'S.D.'], ['max', 'max']];

// Share of the error below which a gain is within what another seed changes: such a gain is not shown.
const spread = 0.2;

export function nameOf(run, index) {
  return el('span', {}, swatch(runVariable(index)), run.name === run.mode ? run.name : `${run.name} (${run.mode})`);
}

function errorTable([key, title, places]) {
  const given = (run) => run.table && run.table[key].rmse !== null;
  const base = data.runs.find((run) => run.mode === 'none' && given(run));
  const compared = base && data.runs.some((run) => run !== base && given(run));
  const best = Object.fromEntries(figures.map(([figure]) =>
    [figure, Math.min(...data.runs.filter((run) => given(run)).map((run) => run.table[key][figure]))]));
  const rows = data.runs.map((run, index) => {
    const cells = figures.map(([figure]) => given(run) && {
      text: run.table[key][figure].toFixed(places),
      best: data.runs.length > 1 && run.table[key][figure] === best[figure],
      title: String(run.table[key][figure]),
    });
    const share = compared && run !== base && given(run)
      ? (base.table[key].rmse - run.table[key].rmse) / base.table[key].rmse : 0;
    const gain = Math.abs(share) >= spread ? `${(100 * share).toFixed(0)} %` : null;
    return [nameOf(run, index), ...cells, ...(compared ? [gain] : [])];
  });
  return table(title, ['run', ...figures.map(([, name]) => name), ...(compared ? ['RMSE gain'] : [])], rows);
}

function runTable() {
  const masks = data.runs.some((run) => run.mask_figures);
  const share = (value) => (value === undefined ? null : value.toFixed(3));
  const rows = data.runs.map((run, index) => {
    const s = run.summary;
    return [nameOf(run, index), run.method, s.frames, s.tracked, s.lost, s.broken,
      `${(100 * s.tracked / Math.max(1, s.frames)).toFixed(1)} %`, s.fps.toFixed(1),
      run.times.stages.tracking?.[0]?.toFixed(1), s.peak_rss_mb?.toFixed(0),
      ...(masks ? [share(run.mask_figures?.iou), share(run.mask_figures?.recall), share(run.mask_figures?.precision)] : [])];
  });
  return table('Coverage, speed' + (masks ? ' and masks' : ''), ['run', 'method', 'frames', 'tracked', 'lost', 'broken',
    'coverage', 'frames/s', 'tracking p50 [ms]', 'memory [MB]', ...(masks ? ['IoU', 'recall', 'precision'] : [])], rows);
}

function problems() {
  return data.runs.filter((run) => run.summary.problem_count > 0).map((run) => el('details', {},
    el('summary', {}, `${run.name}: ${run.summary.problem_count} problems`),
    el('pre', {}, run.summary.problems.join('\n') +
      (run.summary.problem_count > run.summary.problems.length ? '\n... summary.json has them all' : ''))));
}

function meaning() {
  return el('p', { className: 'small' },
    'The absolute trajectory error (ATE) is the distance between estimated and true positions after the two trajectories ' +
    'are laid on each other; the relative pose error (RPE) is that of the motion over one second, which does not add up ' +
    'over time. Read both together with the coverage: a frame without a pose is in no error. Mode none masks nothing.');
}

export function tables() {
  const notes = data.runs.filter((run) => run.why).map((run) =>
    el('p', { className: 'small soft' }, `${run.name}: ${run.why}`));
  const gain = el('p', { className: 'small soft' },
    `RMSE gain: improvement over the run without masks (Eq 13), where it is at least ${100 * spread} %: less is what another ` +
    'seed changes. Bold: the best of a column.');
  const any = data.runs.some((run) => run.table);
  return section('errors', 'Errors', any ? meaning() : null, any ? el('div', { className: 'side' }, measures.map(errorTable)) : null, any && data.runs.length > 1 ? gain : null,
    runTable(), notes, problems());
}
