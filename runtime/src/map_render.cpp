// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/map_render.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace dynslam::runtime {

MapView view_behind(const SE3<double>& T_w_c, double back, double up) {
  // The camera's y axis points down; tilting about its x axis looks down on the scene.
  const SE3<double> offset(SO3<double>::exp(Eigen::Vector3d(-0.35, 0, 0)), Eigen::Vector3d(0, -up, -back));
  MapView view;
  view.T_w_c = T_w_c * offset;
  return view;
}

cv::Mat render_map(const octomap::ColorOcTree& tree, const MapView& view) {
  struct Cube {
    double distance;
    Eigen::Vector3d centre;
    double size;
    cv::Scalar colour;
  };
  std::vector<Cube> cubes;
  const SE3<double> T_c_w = view.T_w_c.inverse();
  for (auto it = tree.begin_leafs(), end = tree.end_leafs(); it != end; ++it) {
    if (!tree.isNodeOccupied(*it)) continue;
    const auto c = it->getColor();
    const Eigen::Vector3d centre(it.getX(), it.getY(), it.getZ());
    const Eigen::Vector3d p = T_c_w * centre;
    if (p.z() < 0.2) continue;
    cubes.push_back({p.squaredNorm(), centre, it.getSize(), cv::Scalar(c.b, c.g, c.r)});
  }
  std::sort(cubes.begin(), cubes.end(), [](const Cube& a, const Cube& b) { return a.distance > b.distance; });  // far first

  cv::Mat image(view.size, CV_8UC3, cv::Scalar(250, 246, 240));
  const Eigen::Vector3d eye = view.T_w_c.translation();
  const auto project = [&](const Eigen::Vector3d& p_w) {
    const Eigen::Vector3d p = T_c_w * p_w;
    const double z = std::max(0.05, p.z());
    return cv::Point(cvRound(16 * (view.focal * p.x() / z + view.size.width / 2.0)), cvRound(16 * (view.focal * p.y() / z + view.size.height / 2.0)));
  };
  for (const Cube& cube : cubes) {
    const double h = cube.size / 2;
    for (int axis = 0; axis < 3; ++axis) {  // of each pair of opposite faces one is seen
      const double side = eye(axis) > cube.centre(axis) ? 1 : -1;
      if (std::abs(eye(axis) - cube.centre(axis)) < h) continue;
      const int u = (axis + 1) % 3, v = (axis + 2) % 3;
      std::array<cv::Point, 4> corner;
      constexpr std::array<std::array<int, 2>, 4> kSigns{{{-1, -1}, {1, -1}, {1, 1}, {-1, 1}}};
      for (std::size_t k = 0; k < 4; ++k) {
        Eigen::Vector3d p = cube.centre;
        p(axis) += side * h;
        p(u) += kSigns[k][0] * h;
        p(v) += kSigns[k][1] * h;
        corner[k] = project(p);
      }
      constexpr std::array<double, 3> kShade{0.82, 1.0, 0.66};
      cv::fillConvexPoly(image, corner.data(), 4, cube.colour * kShade[static_cast<std::size_t>(axis)], cv::LINE_8, 4);
    }
  }
  return image;
}

}  // namespace dynslam::runtime
