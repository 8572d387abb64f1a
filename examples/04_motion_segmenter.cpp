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
  T operator()(int u, int v) const { return pixels[static_cast<std::size_t>(v * 320 + u)]; }
};
int main() {
  const dynslam::Pinhole<float> camera(260, 260, 159.5F, 119.5F);
  dynslam::MotionSegmenter<float, dynslam::Pinhole<float>> segmenter(camera);
  Picture<unsigned char> gray, truth;
  Picture<float> depth;
  double both = 0, either = 0;
  for (int k = 0; k < 40; ++k) {  // a camera drifts sideways before a wall, and a box crosses its view
    const float camera_x = 0.005F * static_cast<float>(k), box_x = -1.2F + 0.05F * static_cast<float>(k);
    for (std::size_t i = 0; i < 320 * 240; ++i) {
      const Eigen::Vector3f ray = camera.ray(Eigen::Vector2f(i % 320, i / 320));
      truth.pixels[i] = std::abs(1.5F * ray.x() + camera_x - box_x) < 0.3F && std::abs(ray.y()) < 0.25F;
      const float z = depth.pixels[i] = truth.pixels[i] ? 1.5F : 3.0F, y = z * ray.y();
      const float x = z * ray.x() + camera_x - (truth.pixels[i] ? box_x : 0);
      gray.pixels[i] = static_cast<unsigned char>(128 + 99 * std::sin(23 * x) * std::sin(31 * y));
    }
    const dynslam::SE3f T_c_w(dynslam::SO3f(), Eigen::Vector3f(-camera_x, 0, 0));  // tracked by your system
    const auto& motion = segmenter.segment(gray, depth, k / 30.0, T_c_w);
    segmenter.remember(T_c_w, motion.mask);  // after dropping features on the mask and tracking again
    for (int i = 0; k >= 10 && i < 320 * 240; ++i) {
      const int hits = (motion.mask(i % 320, i / 320) != 0) + (truth(i % 320, i / 320) != 0);
      both += hits / 2, either += (hits + 1) / 2;
    }
  }
  std::printf("the mask covers what moves with an overlap of %.0f %%\n", 100 * both / either);
  return both > 0.8 * either ? 0 : 1;
}
