// SPDX-License-Identifier: BSD-3-Clause
// Example 4: a SLAM system learns what moves. Its images are plain structs, its poses its own.
#include <cmath>
#include <cstdio>
#include <dynslam/dynamics/motion_segmenter.hpp>
#include <dynslam/geometry/pinhole.hpp>

template <class T>
struct Picture {
  using Pixel = T;
  std::vector<T> pixels = std::vector<T>(320 * 240);
  int width() const { return 320; }
  int height() const { return 240; }
  T& operator()(int u, int v) { return pixels[static_cast<std::size_t>(v * 320 + u)]; }
  T operator()(int u, int v) const { return pixels[static_cast<std::size_t>(v * 320 + u)]; }
};
struct MadeUpSlam {  // a camera that drifts sideways before a wall, and a box that crosses its view
  dynslam::Pinhole<float> camera{260, 260, 159.5F, 119.5F};
  Picture<unsigned char> gray, truth;
  Picture<float> depth;
  dynslam::SE3f read_frame_and_track(int k) {
    const float camera_x = 0.005F * static_cast<float>(k), box_x = -1.2F + 0.05F * static_cast<float>(k);
    for (int v = 0; v < 240; ++v) {
      for (int u = 0; u < 320; ++u) {
        const Eigen::Vector3f ray = camera.ray(Eigen::Vector2f(u, v));
        const bool box = std::abs(1.5F * ray.x() + camera_x - box_x) < 0.3F && std::abs(ray.y()) < 0.25F;
        depth(u, v) = box ? 1.5F : 3.0F;
        const float x = depth(u, v) * ray.x() + camera_x - (box ? box_x : 0), y = depth(u, v) * ray.y();
        gray(u, v) = static_cast<unsigned char>(128 + 50 * std::sin(23 * x + 5 * y) +
                                                50 * std::sin(31 * y - 9 * x * x));
        truth(u, v) = box ? 1 : 0;
      }
    }
    return {dynslam::SO3f(), Eigen::Vector3f(-camera_x, 0, 0)};
  }
};
int main() {
  MadeUpSlam slam;
  dynslam::MotionSegmenter<float, dynslam::Pinhole<float>> segmenter(slam.camera);
  double both = 0, either = 0;
  for (int k = 0; k < 40; ++k) {
    const dynslam::SE3f T_c_w = slam.read_frame_and_track(k);
    const auto& motion = segmenter.segment(slam.gray, slam.depth, T_c_w);
    // Here a system drops the features on motion.mask and optimises its pose again.
    for (int i = 0; k >= 10 && i < 320 * 240; ++i) {
      both += motion.mask(i % 320, i / 320) && slam.truth(i % 320, i / 320) ? 1 : 0;
      either += motion.mask(i % 320, i / 320) || slam.truth(i % 320, i / 320) ? 1 : 0;
    }
    segmenter.remember(T_c_w, motion.mask);
  }
  std::printf("the mask covers what moves with an overlap of %.0f %%\n", 100 * both / either);
  return both > 0.8 * either ? 0 : 1;
}
