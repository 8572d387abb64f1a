// SPDX-License-Identifier: BSD-3-Clause
// What the program put into the page.

export const data = JSON.parse(document.getElementById('data').textContent);

export function bytes(base64) {
  const text = atob(base64);
  const result = new Uint8Array(text.length);
  for (let i = 0; i < text.length; ++i) result[i] = text.charCodeAt(i);
  return result;
}

// The values of an image from its runs: numbers of seven bits a byte, length * 8 + value.
export function decodeRuns(base64, count) {
  const runs = bytes(base64), values = new Uint8Array(count);
  let filled = 0;
  for (let i = 0; i < runs.length;) {
    let number = 0, factor = 1;
    for (;; factor *= 128) {
      const byte = runs[i++];
      number += (byte & 127) * factor;
      if (byte < 128) break;
    }
    const end = filled + Math.floor(number / 8);
    values.fill(number % 8, filled, end);
    filled = end;
  }
  return values;
}

// Keypoints of a frame: {u, v} as shares of the image, weight from 0 to 1.
export function decodeKeypoints(base64) {
  const packed = bytes(base64), points = [];
  for (let i = 0; i + 3 < packed.length; i += 4) {
    const both = packed[i] | (packed[i + 1] << 8) | (packed[i + 2] << 16);
    points.push({ u: (both & 4095) / 4095, v: (both >> 12) / 4095, weight: packed[i + 3] / 255 });
  }
  return points;
}

// The index of the last element not behind `t` in a sorted list.
export function indexAt(times, t) {
  let low = 0, high = times.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (times[middle] <= t + 1e-6) low = middle;
    else high = middle - 1;
  }
  return low;
}
