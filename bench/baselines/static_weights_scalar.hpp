// SPDX-License-Identifier: BSD-3-Clause
// Static weights as one writes them down from Eqs 3 to 7, in double, a match after another: for comparing
// values. Which matches are mismatches is given.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "baselines/residuals_scalar.hpp"
#include "dynslam/image/image.hpp"

namespace dynslam::bench {

struct PlainErrors {
  double reprojection = 0, sigma_z = 0;
  std::optional<double> photometric, depth;
};

[[nodiscard]] inline double plain_median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

/// Scale of t-distributed errors with five degrees of freedom (Kerl et al. 2013), without what is grossly
/// off.
[[nodiscard]] inline double plain_scale(std::vector<double> values, double floor) {
  for (double& e : values) e = std::abs(e);
  double sigma = 1.4826 * plain_median(values);
  const double gross = 6 * sigma;
  for (int round = 0; round < 50; ++round) {
    double sum = 0;
    int n = 0;
    for (const double e : values) {
      if (e > gross) continue;
      sum += 6 / (5 + e * e / (sigma * sigma)) * e * e;
      ++n;
    }
    const double before = sigma;
    sigma = std::sqrt(sum / n);
    if (std::abs(sigma - before) <= 1e-4 * before) break;
  }
  return std::max(floor, sigma);
}

/// @param R, t      pose of the reference camera in the present one's frame; all points are in front of it
/// @param mismatch  a flag per match: has the weight 0 and tells no scale
/// @param floors    grey values, pixels, standard deviations of the depth
[[nodiscard]] inline std::vector<double> plain_static_weights(
    const PlainCamera& camera, std::span<const PlainMatch> matches, const Image<std::uint8_t>& reference,
    const Image<std::uint8_t>& gray, const Image<float>& depth, const Eigen::Matrix3d& R,
    const Eigen::Vector3d& t, std::span<const std::uint8_t> mismatch, const Eigen::Vector3d& floors) {
  std::vector<PlainErrors> errors;
  std::vector<double> e_i, e_c, e_d;
  for (std::size_t k = 0; k < matches.size(); ++k) {
    const PlainMatch& m = matches[k];
    PlainErrors e;
    const Eigen::Vector3d p = R * m.p + t;
    const double u = camera.fx * p.x() / p.z() + camera.cx, v = camera.fy * p.y() / p.z() + camera.cy;
    e.reprojection = std::hypot(u - m.x_m.x(), v - m.x_m.y());
    double before = 0, now = 0;
    if (plain_bilinear(reference, m.x.x(), m.x.y(), int(m.x.x()), int(m.x.y()), before) &&
        plain_bilinear(gray, u, v, int(std::floor(u)), int(std::floor(v)), now))
      e.photometric = before - now;
    const int i = int(std::lround(m.x_m.x())), j = int(std::lround(m.x_m.y()));
    if (depth.contains(i, j) && depth(i, j) > 0) e.depth = p.z() - double(depth(i, j));
    e.sigma_z = 0.001 + 0.0019 * p.z() * p.z();
    errors.push_back(e);
    if (mismatch[k] != 0) continue;
    e_c.push_back(e.reprojection);
    if (e.photometric) e_i.push_back(*e.photometric);
    if (e.depth) e_d.push_back(*e.depth / e.sigma_z);
  }
  const double exposure = plain_median(e_i);
  for (double& e : e_i) e -= exposure;
  const Eigen::Vector3d sigma(plain_scale(e_i, floors[0]), plain_scale(e_c, floors[1]),
                              plain_scale(e_d, floors[2]));
  std::vector<double> weight;
  for (std::size_t k = 0; k < matches.size(); ++k) {
    const PlainErrors& e = errors[k];
    double s = std::pow(e.reprojection / sigma[1], 2);
    if (e.photometric) s += std::pow((*e.photometric - exposure) / sigma[0], 2);
    if (e.depth) s += std::pow(*e.depth / (sigma[2] * e.sigma_z), 2);
    const int d = 1 + (e.photometric ? 1 : 0) + (e.depth ? 1 : 0);
    weight.push_back(mismatch[k] != 0 ? 0 : (5 + d) / (5 + s));
  }
  return weight;
}

}  // namespace dynslam::bench
