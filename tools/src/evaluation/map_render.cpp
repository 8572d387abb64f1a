// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/evaluation/map_render.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "dynslam/runtime/io/map_io.hpp"
#include "io/argument_check.hpp"

namespace dynslam::runtime {

MapView view_behind(const SE3<double>& T_w_c, double back, double up) {
  // The camera's y axis points down; tilting about its x axis looks down on the scene.
  const SE3<double> offset(SO3<double>::exp(Eigen::Vector3d(-0.35, 0, 0)), Eigen::Vector3d(0, -up, -back));
  MapView view;
  view.T_w_c = T_w_c * offset;
  return view;
}

/// Moves a view back, and turns it, until nearly all occupied voxels are in the picture.
MapView fit_view(const interop::SemanticOcTree& tree, MapView view) {
  std::vector<Eigen::Vector3d> points;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (auto it = tree.begin_leafs(), end = tree.end_leafs(); it != end; ++it) {
    if (!tree.isNodeOccupied(*it)) continue;
    points.emplace_back(it.getX(), it.getY(), it.getZ());
    centre += points.back();
  }
  if (points.empty()) return view;
  centre /= static_cast<double>(points.size());
  // Turn about the eye: the shortest rotation that brings the centre onto the optical axis.
  const Eigen::Vector3d c = view.T_w_c.inverse() * centre;
  if (c.norm() > 1e-6) {
    view.T_w_c = view.T_w_c * SE3<double>(Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), c),
                                          Eigen::Vector3d::Zero());
  }
  const SE3<double> T_c_w = view.T_w_c.inverse();
  // Distance that a point asks for so that |x| f / (z + back) stays within 0.46 of the picture's size.
  std::vector<double> back;
  for (const Eigen::Vector3d& p_w : points) {
    const Eigen::Vector3d p = T_c_w * p_w;
    const double x = std::abs(p.x()) / (0.46 * view.size.width),
                 y = std::abs(p.y()) / (0.46 * view.size.height);
    back.push_back(view.focal * std::max(x, y) - p.z());
  }
  const auto most = back.begin() + static_cast<std::ptrdiff_t>(0.999 * static_cast<double>(back.size() - 1));
  std::nth_element(back.begin(), most, back.end());
  const double nearest = (T_c_w * centre).z() - 0.8;  // never so far in that the scene is behind the eye
  view.T_w_c = view.T_w_c * SE3<double>(SO3<double>(), Eigen::Vector3d(0, 0, std::min(-*most, nearest)));
  return view;
}

namespace {

/// From blue over green to red, t from 0 to 1.
cv::Scalar rainbow(double t) {
  const auto peak = [t](double at) { return 255.0 * std::clamp(1.6 - 4.0 * std::abs(t - at), 0.0, 1.0); };
  return {peak(0.15), peak(0.5), peak(0.85)};
}

}  // namespace

cv::Mat render_map(const interop::SemanticOcTree& tree, const MapView& view, MapColours colours,
                   const Eigen::Vector3d& up) {
  check_pose(view.T_w_c, "render_map(): the viewpoint");
  check_argument(view.size.width >= 1 && view.size.height >= 1 && view.size.width <= 20000 &&
                     view.size.height <= 20000 && view.focal > 0 && view.focal < 1e9,
                 "render_map(): expected a size from 1x1 to 20000x20000 and a focal length above 0");
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
    const Eigen::Vector3d centre(it.getX(), it.getY(), it.getZ());
    const Eigen::Vector3d p = T_c_w * centre;
    if (p.z() < 0.2) continue;
    const Rgb c = voxel_colour(*it);
    cubes.push_back({p.squaredNorm(), centre, it.getSize(), cv::Scalar(c[2], c[1], c[0])});
  }
  if (colours == MapColours::height && !cubes.empty()) {
    std::vector<double> heights;
    for (const Cube& cube : cubes) heights.push_back(up.dot(cube.centre));
    std::sort(heights.begin(), heights.end());
    // Without the extreme hundredth: one stray voxel must not squeeze all others into one colour.
    const double low = heights[heights.size() / 100],
                 high = heights[heights.size() - 1 - heights.size() / 100];
    for (Cube& cube : cubes) cube.colour = rainbow((up.dot(cube.centre) - low) / std::max(high - low, 1e-6));
  }
  std::sort(cubes.begin(), cubes.end(),
            [](const Cube& a, const Cube& b) { return a.distance > b.distance; });  // far first

  cv::Mat image(view.size, CV_8UC3, cv::Scalar(250, 246, 240));
  const Eigen::Vector3d eye = view.T_w_c.translation();
  const auto project = [&](const Eigen::Vector3d& p_w) {
    const Eigen::Vector3d p = T_c_w * p_w;
    const double z = std::max(0.05, p.z());
    return cv::Point(cvRound(16 * (view.focal * p.x() / z + view.size.width / 2.0)),
                     cvRound(16 * (view.focal * p.y() / z + view.size.height / 2.0)));
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
      cv::fillConvexPoly(image, corner.data(), 4, cube.colour * kShade[static_cast<std::size_t>(axis)],
                         cv::LINE_8, 4);
    }
  }
  return image;
}

}  // namespace dynslam::runtime
