// SPDX-License-Identifier: BSD-3-Clause
// The residual triple and the joint weight as one writes them down from Eqs 3 to 7: a match after another, in
// one scalar type. Also evaluated with ceres::Jet.
#pragma once

#include <cmath>

#include <Eigen/Core>

#include "dynslam/image/image.hpp"

namespace dynslam::bench {

struct PlainMatch {
  Eigen::Vector2d x;
  Eigen::Vector3d p;
  Eigen::Vector2d x_m;
};
struct PlainCamera {
  double fx, fy, cx, cy;
};
template <class T>
struct PlainResidual {
  T photometric, reprojection, depth, weight;
};

/// Value of a grey image between pixels; false outside.
template <class T>
bool plain_bilinear(const Image<std::uint8_t>& image, const T& u, const T& v, int u0, int v0, T& value) {
  if (u0 < 0 || v0 < 0 || u0 + 1 >= image.width() || v0 + 1 >= image.height()) return false;
  const T a = u - T(double(u0)), b = v - T(double(v0));
  value = (T(1.0) - b) * ((T(1.0) - a) * T(double(image(u0, v0))) + a * T(double(image(u0 + 1, v0)))) +
          b * ((T(1.0) - a) * T(double(image(u0, v0 + 1))) + a * T(double(image(u0 + 1, v0 + 1))));
  return true;
}

/// @param R, t   pose of the reference camera in the present one's frame
/// @param floor  the integer below a T, as a number
template <class T, class Floor>
PlainResidual<T> plain_residual(const PlainCamera& camera, const PlainMatch& m,
                                const Image<std::uint8_t>& reference, const Image<std::uint8_t>& gray,
                                const Image<float>& depth, const Eigen::Matrix<T, 3, 3>& R,
                                const Eigen::Matrix<T, 3, 1>& t, const Eigen::Vector3d& sigma, double nu,
                                const Floor& floor) {
  using std::sqrt;
  PlainResidual<T> r{T(0.0), T(0.0), T(0.0), T(0.0)};
  const Eigen::Matrix<T, 3, 1> p = R * m.p.cast<T>() + t;
  const T u = T(camera.fx) * p.x() / p.z() + T(camera.cx), v = T(camera.fy) * p.y() / p.z() + T(camera.cy);
  const T du = u - T(m.x_m.x()), dv = v - T(m.x_m.y());
  r.reprojection = sqrt(du * du + dv * dv);
  T s = r.reprojection * r.reprojection / T(sigma[1] * sigma[1]);
  int d = 1;
  double before = 0;
  T now;
  if (plain_bilinear(reference, m.x.x(), m.x.y(), int(m.x.x()), int(m.x.y()), before) &&
      plain_bilinear(gray, u, v, floor(u), floor(v), now)) {
    r.photometric = T(before) - now;
    s += r.photometric * r.photometric / T(sigma[0] * sigma[0]);
    ++d;
  }
  const int i = int(std::lround(m.x_m.x())), j = int(std::lround(m.x_m.y()));
  if (i >= 0 && j >= 0 && i < depth.width() && j < depth.height() && depth(i, j) > 0) {
    r.depth = p.z() - T(double(depth(i, j)));
    const T sigma_z = T(sigma[2]) * (T(0.001) + T(0.0019) * p.z() * p.z());
    s += r.depth * r.depth / (sigma_z * sigma_z);
    ++d;
  }
  r.weight = T(nu + d) / (T(nu) + s);
  return r;
}

}  // namespace dynslam::bench
