// SPDX-License-Identifier: BSD-3-Clause
// Example 5: which matches of two fisheye images moved; the images are of a type of one's own.
#include <cmath>
#include <cstdio>
#include <dynslam/dynamics/static_weights.hpp>
#include <dynslam/geometry/kannala_brandt.hpp>

struct Picture {  // column after column
  using Pixel = float;
  std::vector<float> pixels = std::vector<float>(320 * 240, 2.0F);
  int width() const { return 320; }
  int height() const { return 240; }
  float& operator()(int u, int v) { return pixels[static_cast<std::size_t>(u * 240 + v)]; }
  float operator()(int u, int v) const { return pixels[static_cast<std::size_t>(u * 240 + v)]; }
};

int main() {
  const dynslam::KannalaBrandt<double> camera(120, 120, 159.5, 119.5, {-0.01, 0.002, 0, 0});
  const dynslam::SE3d T_cur_ref(dynslam::SO3d(), Eigen::Vector3d(-0.1, 0, 0));
  Picture depth, before, after;  // a wall 2 m away, seen from two places
  std::vector<dynslam::KeypointMatch<double>> matches;
  for (int u = 0; u < 320; ++u) {
    for (int v = 0; v < 240; ++v) {
      const auto p = camera.unproject({u, v}, 2);
      if (!p) continue;
      before(u, v) = static_cast<float>(128 + 60 * std::sin(9 * p->x()) * std::cos(7 * p->y()));
      after(u, v) = static_cast<float>(128 + 60 * std::sin(9 * (p->x() + 0.1)) * std::cos(7 * p->y()));
      if (u % 16 != 8 || v % 16 != 8) continue;
      const Eigen::Vector2d moved(u < 100 ? 9 : 0, 0);  // what is on the left was carried on
      matches.push_back(*dynslam::keypoint_match(camera, {u, v}, 2, *camera.project(T_cur_ref * *p) + moved));
    }
  }
  const auto w = dynslam::static_weights(camera, matches, before, after, depth, T_cur_ref);
  std::size_t right = 0;
  for (std::size_t k = 0; w.ok() && k < matches.size(); ++k)
    right += (w.dynamic[k] || w.mismatch[k]) == (matches[k].x.x() < 100) ? 1U : 0U;
  std::printf("%zu of %zu right, %d dynamic\n", right, matches.size(), w.dynamic_matches);
  return right > matches.size() * 9 / 10 ? 0 : 1;
}
