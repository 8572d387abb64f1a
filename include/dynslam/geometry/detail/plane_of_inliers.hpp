// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <optional>
#include <vector>

#include "dynslam/geometry/detail/best_model.hpp"
#include "dynslam/geometry/minimal_models.hpp"
#include "dynslam/geometry/so3.hpp"
#include "dynslam/robust/consensus.hpp"
#include "dynslam/robust/split_mix64.hpp"

namespace dynslam::detail {

/// The H that half the inliers of the best epipolar geometry, or more, agree on.
/// @param planes  the search for H
/// @param index   scratch
template <class Matches, class Search, class PlaneSearch>
[[nodiscard]] std::optional<Eigen::Matrix3d> plane_of_inliers(const Matches& matches, SplitMix64& random,
                                                              const Search& epipolar, PlaneSearch& planes,
                                                              const BestModel<Search>& best,
                                                              std::vector<int>& index) {
  constexpr int kSamples = 20, kRefinements = 3;
  BestModel plane(planes, kRefinements);
  index.clear();
  for (std::size_t i = 0; i < matches.size(); ++i) {
    if (epipolar.near(best.model(), i)) index.push_back(static_cast<int>(i));
  }
  if (index.size() < 8) return std::nullopt;
  for (int k = 0; k < kSamples && 10 * plane.inliers() < 9 * best.inliers(); ++k) {
    std::array<std::size_t, 4> sample{};
    draw_distinct(random, index.size(), sample);
    Eigen::Matrix<double, 3, 4> p, q;
    for (std::size_t j = 0; j < 4; ++j)
      matches.copy_points(static_cast<std::size_t>(index[sample[j]]), p.data() + 3 * j, q.data() + 3 * j);
    if (const auto H = homography_four_point(p, q)) plane.consider(*H, 4);
  }
  if (2 * plane.inliers() < best.inliers()) return std::nullopt;
  plane.finish();
  return plane.model();
}

/// The two essential matrices, of norm 1, of the motions that map a plane's rays by H (Ma et al. 2003,
/// 5.3.3).
/// @return nullopt where H is a rotation
template <std::same_as<double> W>
[[nodiscard]] std::optional<std::array<Eigen::Matrix<W, 3, 3>, 2>> essentials_of_plane(
    const Eigen::Matrix<W, 3, 3>& H) {
  using Matrix3 = Eigen::Matrix<W, 3, 3>;
  using Vector3 = Eigen::Matrix<W, 3, 1>;
  const Matrix3 H_T = H.transpose();
  const Eigen::SelfAdjointEigenSolver<Matrix3> eigen(product<W>(H_T, H));
  const W middle = eigen.eigenvalues()[1];
  if (eigen.info() != Eigen::Success || !(middle > W(0))) return std::nullopt;
  // Squared singular values of H as far as it is R + t n^T, whose middle one is 1.
  const W least = eigen.eigenvalues()[0] / middle, most = eigen.eigenvalues()[2] / middle;
  if (!(most - least > W(1e-8))) return std::nullopt;
  const Matrix3 scaled = H / std::sqrt(middle);
  const Vector3 v = eigen.eigenvectors().col(1);
  const Vector3 a = std::sqrt(std::max(W(0), W(1) - least) / (most - least)) * eigen.eigenvectors().col(2),
                b = std::sqrt(std::max(W(0), most - W(1)) / (most - least)) * eigen.eigenvectors().col(0);
  std::array<Matrix3, 2> E;
  for (std::size_t k = 0; k < 2; ++k) {
    // In the plane of v and u nothing is stretched: H turns it as R does.
    const Vector3 u = k == 0 ? Vector3(a + b) : Vector3(a - b), n = v.cross(u);
    const Vector3 v_m = product<W>(scaled, v), u_m = product<W>(scaled, u);
    Matrix3 from, to;
    from << v, u, n;
    to << v_m, u_m, v_m.cross(u_m);
    const Matrix3 from_T = from.transpose(), R = product<W>(to, from_T);
    const Vector3 t = product<W>(scaled, n) - product<W>(R, n);
    E[k] = product<W>(SO3<W>::hat(t), R);
    const W norm = E[k].norm();
    if (!(norm > W(0)) || !std::isfinite(norm)) return std::nullopt;
    E[k] /= norm;
  }
  return E;
}

}  // namespace dynslam::detail

#include "dynslam/pop_macros.hpp"
