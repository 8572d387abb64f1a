// SPDX-License-Identifier: BSD-3-Clause
// What is chosen on the page: a run and a frame. Whoever shows either is told of changes.

const listeners = { run: [], frame: [], theme: [] };
export const state = { run: 0, frame: 0 };

export function on(what, listener) {
  listeners[what].push(listener);
}

export function tell(what) {
  for (const listener of listeners[what]) listener();
}

export function choose(what, value) {
  if (state[what] === value) return;
  state[what] = value;
  tell(what);
}
