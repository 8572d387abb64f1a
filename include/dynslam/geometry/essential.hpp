// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>
#include <vector>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/geometry/detail/plane_of_inliers.hpp"
#include "dynslam/geometry/detail/ray_search.hpp"
#include "dynslam/geometry/five_point.hpp"
#include "dynslam/geometry/pixel_ray.hpp"
#include "dynslam/geometry/ray_matches.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/robust/consensus.hpp"
#include "dynslam/robust/split_mix64.hpp"

namespace dynslam {

/// E of a motion: [t]x R with T_cur_ref = (R, t). Zero for t = 0.
template <Scalar S>
[[nodiscard]] Eigen::Matrix<S, 3, 3> essential_from_pose(const SE3<S>& T_cur_ref) {
  return detail::product<S>(SO3<S>::hat(T_cur_ref.translation()), T_cur_ref.rotation_matrix());
}

/// The four motions (R, t) with an essential matrix, |t| = 1, t and -t beside each other (Hartley and
/// Zisserman, 9.6.2).
template <std::floating_point S>
[[nodiscard]] std::array<SE3<S>, 4> poses_from_essential(const Eigen::Matrix<S, 3, 3>& E) {
  using Matrix3 = Eigen::Matrix<S, 3, 3>;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  const Eigen::JacobiSVD<Matrix3> svd(E, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Matrix3 U = svd.matrixU(), V = svd.matrixV();
  for (Matrix3* m : {&U, &V}) {
    if (m->determinant() < S(0)) m->col(2) = -m->col(2);
  }
  Matrix3 turn;
  turn << S(0), S(-1), S(0), S(1), S(0), S(0), S(0), S(0), S(1);
  const Vector3 t = U.col(2);
  std::array<SE3<S>, 4> poses;
  for (std::size_t k = 0; k < 2; ++k) {
    const Matrix3 W = k == 0 ? turn : Matrix3(turn.transpose());
    const SO3<S> R(detail::product<S>(detail::product<S>(U, W), Matrix3(V.transpose())));
    poses[2 * k] = SE3<S>(R, t);
    poses[2 * k + 1] = SE3<S>(R, Vector3(-t));
  }
  return poses;
}

/// How essential_ransac ended.
enum class EssentialStatus : std::uint8_t { ok, too_few_points, no_consensus };

/// What essential_ransac found.
template <std::floating_point S>
struct EssentialResult {
  Eigen::Matrix<S, 3, 3> E = Eigen::Matrix<S, 3, 3>::Zero();  ///< of rays, norm 1: [t]x R, to scale
  SE3<S> T_cur_ref;                  ///< the motion, |t| = 1, with most inliers before both cameras
  std::vector<std::uint8_t> inlier;  ///< one flag per match
  int inliers = 0;
  int iterations = 0;
  EssentialStatus status = EssentialStatus::too_few_points;
  [[nodiscard]] bool ok() const { return status == EssentialStatus::ok; }
};

namespace detail {
/// Whether the rays of a match meet before both cameras.
template <std::floating_point S>
[[nodiscard]] bool in_front(const SE3<S>& T_cur_ref, const Eigen::Matrix<S, 3, 1>& p,
                            const Eigen::Matrix<S, 3, 1>& q) {
  // b q = a R p + t: a and b by what is across q and across R p.
  const Eigen::Matrix<S, 3, 1> turned = T_cur_ref.so3() * p, across = q.cross(turned);
  const Eigen::Matrix<S, 3, 1>& t = T_cur_ref.translation();
  return across.dot(t.cross(q)) > S(0) && across.dot(t.cross(turned)) > S(0);
}
}  // namespace detail

/// E by RANSAC over five-point samples with an adaptive number of iterations, refined on its inliers by
/// Sampson's distance over the motion. To be preferred to F where the camera is known: five unknowns instead
/// of seven are nearer to the truth, and a plane determines them.
/// @param x, x_m  rays of the matches, through any lens; thresholds are of Sampson's distance in recorded
///                pixels
template <std::same_as<double> W = double>  // of a template nothing is compiled where it is not used
[[nodiscard]] EssentialResult<W> essential_ransac(std::type_identity_t<std::span<const PixelRay<W>>> x,
                                                  std::type_identity_t<std::span<const PixelRay<W>>> x_m,
                                                  const RansacOptions<W>& options,
                                                  RansacWorkspace& workspace) {
  const std::size_t n = std::min(x.size(), x_m.size());
  EssentialResult<W> result;
  result.inlier.assign(n, 0);
  if (n < detail::least_matches(6, options)) return result;
  result.status = EssentialStatus::no_consensus;
  detail::RayMatches matches;
  matches.set(x, x_m, workspace, false);
  const double limit = options.threshold_px * options.threshold_px;
  detail::RayEssentialSearch<W> search(matches, limit);
  detail::BestModel best(search, options.refinements);
  result.iterations = detail::search_models<5, W>(
      n, options, best, [&](const std::array<std::size_t, 5>& sample, const auto& consider) {
        Eigen::Matrix<W, 3, 5> p, q;
        for (std::size_t k = 0; k < 5; ++k)
          matches.copy_points(sample[k], p.data() + 3 * k, q.data() + 3 * k);
        std::array<Eigen::Matrix<W, 3, 3>, 10> E;
        const int hypotheses = essential_five_point(p, q, E);
        for (int k = 0; k < hypotheses; ++k) consider(E[static_cast<std::size_t>(k)]);
      });
  // A plane's matches leave two motions, the better of which is told by the few that are off it.
  SplitMix64 random(options.seed);
  detail::RayHomographySearch<W> planes(matches, limit);
  if (const auto H = detail::plane_of_inliers(matches, random, search, planes, best, workspace.index)) {
    if (const auto candidates = detail::essentials_of_plane<W>(*H)) {
      for (const auto& E : *candidates) best.challenge(E);
    }
  }
  constexpr int kFewest = 20;  // the few samples of five that are needed leave more to be found
  best.draw_from_inliers(std::max(kFewest, detail::idle_draws(result.iterations)), options.seed,
                         workspace.index);
  best.finish();
  if (best.inliers() == 0) return result;
  const auto poses = poses_from_essential<W>(best.model());
  const Eigen::Matrix<W, 3, 3> E = essential_from_pose(poses[0]);
  std::array<int, 4> before{};
  for (std::size_t i = 0; i < n; ++i) {
    result.inlier[i] = sampson_distance_squared<W>(E, x[i], x_m[i]) <= limit ? 1 : 0;
    if (result.inlier[i] == 0) continue;
    ++result.inliers;
    for (std::size_t k = 0; k < 4; ++k)
      before[k] += detail::in_front<W>(poses[k], x[i].ray, x_m[i].ray) ? 1 : 0;
  }
  const auto most = std::max_element(before.begin(), before.end());
  result.T_cur_ref = poses[static_cast<std::size_t>(most - before.begin())];
  result.E = essential_from_pose(result.T_cur_ref);
  result.E /= result.E.norm();
  if (result.inliers >= options.min_inliers) result.status = EssentialStatus::ok;
  return result;
}

/// Memory of essential_ransac of pixels.
struct EssentialWorkspace {
  std::vector<PixelRay<double>> x, x_m;  // of the matches that have them
  std::vector<std::size_t> match;
  RansacWorkspace ransac;
};

/// The same of recorded pixels. Matches that are not finite, or where the lens has no ray, are outliers.
/// @param camera  any with a derivative
template <DifferentiableCamera C>
  requires std::floating_point<typename C::ScalarType>
[[nodiscard]] EssentialResult<typename C::ScalarType> essential_ransac(
    const C& camera, std::type_identity_t<std::span<const Eigen::Matrix<typename C::ScalarType, 2, 1>>> x,
    std::type_identity_t<std::span<const Eigen::Matrix<typename C::ScalarType, 2, 1>>> x_m,
    const RansacOptions<typename C::ScalarType>& options, EssentialWorkspace& workspace) {
  using S = typename C::ScalarType;
  EssentialResult<S> result;
  const std::size_t n = std::min(x.size(), x_m.size());
  detail::rays_of_matches(camera, x.first(n), x_m.first(n), workspace.x, workspace.x_m, workspace.match);
  const EssentialResult<double> found =
      essential_ransac(workspace.x, workspace.x_m, detail::ransac_in_double(options), workspace.ransac);
  result.E = found.E.template cast<S>();
  result.T_cur_ref = found.T_cur_ref.template cast<S>();
  result.inlier.assign(n, 0);
  for (std::size_t k = 0; k < workspace.match.size(); ++k)
    result.inlier[workspace.match[k]] = found.inlier[k];
  result.inliers = found.inliers;
  result.iterations = found.iterations;
  result.status = found.status;
  return result;
}

/// The same with its own memory.
template <DifferentiableCamera C>
  requires std::floating_point<typename C::ScalarType>
[[nodiscard]] EssentialResult<typename C::ScalarType> essential_ransac(
    const C& camera, std::type_identity_t<std::span<const Eigen::Matrix<typename C::ScalarType, 2, 1>>> x,
    std::type_identity_t<std::span<const Eigen::Matrix<typename C::ScalarType, 2, 1>>> x_m,
    const RansacOptions<typename C::ScalarType>& options = {}) {
  EssentialWorkspace workspace;
  return essential_ransac(camera, x, x_m, options, workspace);
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
