// SPDX-License-Identifier: BSD-3-Clause
// Pictures and masks of frames.
import { data, decodeRuns } from './data.js';

const [width, height] = data.frames.mask_size;
const layer = document.createElement('canvas');
layer.width = width;
layer.height = height;

// A picture; null where there is none.
export async function load(jpeg) {
  if (!jpeg) return null;
  const image = new Image();
  image.src = `data:image/jpeg;base64,${jpeg}`;
  await image.decode();
  return image;
}

export const plane = (runs) => decodeRuns(runs, width * height);

function components(colour) {
  const context = layer.getContext('2d', { willReadFrequently: true });
  context.clearRect(0, 0, 1, 1);
  context.fillStyle = colour;
  context.fillRect(0, 0, 1, 1);
  return context.getImageData(0, 0, 1, 1).data;
}

// Tints what has a bit in a plane.
export function overlay(target, values, bit, colour, opacity) {
  const [r, g, b] = components(colour);
  const context = layer.getContext('2d', { willReadFrequently: true });
  const image = context.createImageData(width, height);
  for (let i = 0; i < values.length; ++i) {
    if ((values[i] & bit) === 0) continue;
    image.data.set([r, g, b, Math.round(255 * opacity)], 4 * i);
  }
  context.putImageData(image, 0, 0);
  target.imageSmoothingEnabled = false;
  target.drawImage(layer, 0, 0, target.canvas.width, target.canvas.height);
}
