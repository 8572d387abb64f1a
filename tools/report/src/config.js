// SPDX-License-Identifier: BSD-3-Clause
// What the runs were made with.
import { data } from './data.js';
import { el, section, table } from './dom.js';

// {"table.key": value} of a configuration file. It leaves out tuning fields that have their defaults.
function fields(text) {
  const result = {};
  let table = '';
  for (const line of text.split('\n')) {
    const head = line.match(/^\[(.*)\]$/), field = line.match(/^([A-Za-z_0-9]+) = (.*)$/);
    if (head) table = head[1];
    else if (field) result[`${table}.${field[1]}`] = field[2];
  }
  return result;
}

function differences() {
  const all = data.runs.map((run) => fields(run.config));
  const names = [...new Set(all.flatMap(Object.keys))].filter((name) => new Set(all.map((one) => one[name])).size > 1);
  if (names.length === 0) return el('p', { className: 'small soft' }, 'All runs have the same configuration.');
  return table('What differs', ['field', ...data.runs.map((run) => run.name)],
    names.map((name) => [name, ...all.map((one) => one[name] ?? 'default')]));
}

export function configuration() {
  const versions = table('Versions', ['', ...data.runs.map((run) => run.name)],
    [...new Set(data.runs.flatMap((run) => Object.keys(run.versions)))].map((name) =>
      [name, ...data.runs.map((run) => run.versions[name])]));
  return section('config', 'Configuration and versions', versions, data.runs.length > 1 ? differences() : null,
    data.runs.map((run) => el('details', { open: data.runs.length === 1 },
      el('summary', {}, `${run.name}: effective configuration (config.toml)`), el('pre', {}, run.config))));
}
