// SPDX-License-Identifier: BSD-3-Clause
// Lines of some pixels' width, which WebGL's own lines do not have.
import { Line2 } from 'three/addons/lines/Line2.js';
import { LineGeometry } from 'three/addons/lines/LineGeometry.js';
import { LineMaterial } from 'three/addons/lines/LineMaterial.js';

// Through points (x y z of each).
export function thickLine(points, linewidth, dashed = false) {
  const all = points.length === 3 ? [...points, ...points] : points;
  const line = new Line2(new LineGeometry().setPositions(all),
    new LineMaterial({ linewidth, dashed, dashSize: 0.03, gapSize: 0.02 }));
  if (dashed) line.computeLineDistances();
  return line;
}
