// SPDX-License-Identifier: BSD-3-Clause
// What scripts/results.sh compiles to see what static_weights() costs a compiler.
#include <dynslam/dynamics/static_weights.hpp>
#include <dynslam/geometry/pinhole.hpp>
#include <dynslam/image/image_view.hpp>
#include <vector>

int main() {
  const dynslam::Pinhole<double> camera(500, 500, 320, 240);
  const std::vector<dynslam::KeypointMatch<double>> matches;
  const dynslam::ImageView<const unsigned char> grey(nullptr, 0, 0);
  const dynslam::ImageView<const float> depth(nullptr, 0, 0);
  return dynslam::static_weights(camera, matches, grey, grey, depth, dynslam::SE3d()).ok() ? 1 : 0;
}
