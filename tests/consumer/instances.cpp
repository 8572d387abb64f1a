// SPDX-License-Identifier: BSD-3-Clause
// Uses what dynslam::core_instances has compiled.
#include <dynslam/dynamics/motion_segmenter.hpp>
#include <dynslam/geometry/pinhole.hpp>
#include <vector>

int main() {
  dynslam::MotionSegmenter<float, dynslam::Pinhole<float>> segmenter({80, 80, 79.5F, 59.5F});
  const std::vector<unsigned char> grey(160 * 120, 100);
  const std::vector<float> depth(160 * 120, 2.0F);
  const dynslam::ImageView<const unsigned char> g(grey.data(), 160, 120);
  const dynslam::ImageView<const float> d(depth.data(), 160, 120);
  for (int k = 0; k < 3; ++k) {
    const auto& motion = segmenter.segment(g, d, k / 30.0, dynslam::SE3f());
    if (!motion.ok() || motion.seeds != 0) return 1;
    segmenter.remember(dynslam::SE3f(), motion.mask);
  }
  return 0;
}
