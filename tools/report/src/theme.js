// SPDX-License-Identifier: BSD-3-Clause
// Colours of the light or dark scheme, from the style sheet.
import { tell } from './state.js';

export function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

export const runVariable = (index) => `var(--run${index % 6})`;
export const runColour = (index) => colour(`run${index % 6}`);

// Stages of a frame's work, distinct in both schemes.
export const stageColours = {
  initial_pose: '#4e79a7', local_map: '#59a14f', lucas_kanade: '#f28e2b', residuals: '#e15759', free_space: '#b07aa1',
  growing: '#9c755f', pose: '#3fa7a0', keyframe: '#d4a72c', features: '#8c8fa3', network: '#d37295', mask_keeper: '#a0a0a0',
};

export function watchTheme() {
  window.matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => tell('theme'));
}
