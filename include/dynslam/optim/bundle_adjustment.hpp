// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <type_traits>
#include <vector>

#include "dynslam/concepts/robust.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/optim/levenberg_marquardt.hpp"
#include "dynslam/optim/normal_equations.hpp"
#include "dynslam/optim/pose_residual.hpp"
#include "dynslam/robust/rho_sum.hpp"
#include "dynslam/robust/t_distribution.hpp"

namespace dynslam {

/// What is adjusted. The spans must outlive the call; poses and points are changed in place.
template <Scalar S>
struct BundleProblem {
  std::span<SE3<S>> poses;                             ///< T_c_w
  std::span<const std::uint8_t> fixed;                 ///< per pose: nonzero = not changed (the gauge)
  std::span<Eigen::Matrix<S, 3, 1>> points;            ///< world [m]
  std::span<const BundleObservation<S>> observations;  ///< sorted by point
};

/// Options of bundle_adjust.
template <Scalar S>
struct BundleOptions {
  int max_iterations = 10;  ///< solved systems, refused steps included
  S initial_damping = S(1e-4);
  S tolerance = S(1e-6);     ///< relative decrease of the cost that ends the iteration
  S min_damping = S(1e-10);  ///< of Levenberg-Marquardt (see there)
  S max_damping = S(1e8);    ///< beyond, the adjustment has stalled
  S held_depth = S(1e-9);    ///< share of a point's information that is added in all directions: one sight
                             ///< without depth leaves the distance open, which is held by this
};

/// How an adjustment ended.
enum class BundleStatus : std::uint8_t {
  converged,
  max_iterations,  ///< still decreasing; the result is usable
  stalled,         ///< no damping gave a decrease; the parameters are those of the last accepted step
  no_free_pose,    ///< nothing to do
  no_gauge,        ///< no pose is fixed
  bad_input        ///< sizes that disagree, observations unsorted or out of range, or a non-finite cost
};

/// What bundle_adjust did; poses and points are changed in place.
template <Scalar S>
struct BundleResult {
  BundleStatus status = BundleStatus::bad_input;
  S initial_cost = S(0), final_cost = S(0);  ///< sum of rho over the observations that their cameras see
  int iterations = 0;
  [[nodiscard]] bool ok() const {
    return status == BundleStatus::converged || status == BundleStatus::max_iterations ||
           status == BundleStatus::stalled;
  }
};

/// Memory of bundle_adjust; keep it between calls: nothing is allocated while the sizes stay, and nothing
/// while iterating.
template <Scalar S>
struct BundleWorkspace {
  using Matrix63 = Eigen::Matrix<S, 6, 3>;
  std::vector<int> column;             // per pose: index among the free ones, -1 fixed
  std::vector<std::uint8_t> in_front;  // per observation: has been in front of its camera
  std::vector<Matrix63, Eigen::aligned_allocator<Matrix63>> W;  // per observation: J_pose^T J_point
  std::vector<Eigen::Matrix<S, 3, 3>> V, V_inverse;             // per point
  std::vector<Eigen::Matrix<S, 3, 1>> b_point;
  std::vector<Eigen::Matrix<S, 6, 6>> U;  // per free pose
  std::vector<Eigen::Matrix<S, 6, 1>> b_pose;
  std::vector<SE3<S>> poses;  // before the trial step
  std::vector<Eigen::Matrix<S, 3, 1>> points;
  Eigen::Matrix<S, Eigen::Dynamic, Eigen::Dynamic> reduced;
  Eigen::Matrix<S, Eigen::Dynamic, 1> rhs, step;
  Eigen::LLT<Eigen::Matrix<S, Eigen::Dynamic, Eigen::Dynamic>> factor;
};

/// An observation of a bundle as one of a pose.
template <Scalar S>
[[nodiscard]] PoseObservation<S> pose_observation(const BundleObservation<S>& o,
                                                  const std::type_identity_t<Eigen::Matrix<S, 3, 1>>& p_w) {
  return {p_w, o.x, o.depth, o.inv_sigma_px2, o.inv_sigma_z2};
}

/// Squared normalised error of an observation; infinity where the camera does not see the point.
template <Scalar S, CameraOf<S> Camera>
[[nodiscard]] S bundle_chi2(const Camera& camera, const SE3<S>& T_c_w,
                            const std::type_identity_t<Eigen::Matrix<S, 3, 1>>& p_w,
                            const BundleObservation<S>& o) {
  return observation_chi2(camera, T_c_w, pose_observation(o, p_w));
}

namespace detail {

/// Poses and points of a bundle as a LeastSquaresProblem.
template <std::floating_point S, class Camera, class Kernel>
class BundleSolver {
 public:
  BundleSolver(const Camera& camera, const BundleProblem<S>& problem, const BundleOptions<S>& options,
               const Kernel& kernel, BundleWorkspace<S>& workspace)
      : camera_(camera), problem_(problem), options_(options), kernel_(kernel), ws_(workspace) {}

  /// Checks the problem and makes the workspace fit. @return what stands against it, if anything does
  [[nodiscard]] std::optional<BundleStatus> prepare() {
    const auto pose_count = static_cast<int>(problem_.poses.size()),
               point_count = static_cast<int>(problem_.points.size());
    if (problem_.fixed.size() != problem_.poses.size()) return BundleStatus::bad_input;
    int last = 0;
    for (const BundleObservation<S>& o : problem_.observations) {
      if (o.pose < 0 || o.pose >= pose_count || o.point < last || o.point >= point_count)
        return BundleStatus::bad_input;
      if (!std::isfinite(o.x.x()) || !std::isfinite(o.x.y())) return BundleStatus::bad_input;
      last = o.point;
    }
    free_ = 0;
    ws_.column.assign(problem_.poses.size(), -1);
    for (std::size_t i = 0; i < problem_.poses.size(); ++i) {
      if (problem_.fixed[i] == 0) ws_.column[i] = free_++;
    }
    if (free_ == 0) return BundleStatus::no_free_pose;
    if (free_ == pose_count) return BundleStatus::no_gauge;
    ws_.W.resize(problem_.observations.size());
    ws_.V.resize(problem_.points.size());
    ws_.V_inverse.resize(problem_.points.size());
    ws_.b_point.resize(problem_.points.size());
    ws_.U.resize(static_cast<std::size_t>(free_));
    ws_.b_pose.resize(static_cast<std::size_t>(free_));
    ws_.poses.resize(problem_.poses.size());
    ws_.points.resize(problem_.points.size());
    ws_.reduced.resize(6 * free_, 6 * free_);
    ws_.rhs.resize(6 * free_);
    ws_.step.resize(6 * free_);
    ws_.in_front.assign(problem_.observations.size(), 0);
    return std::nullopt;
  }

  /// Cost at the start. Those in front of their cameras count from now on.
  [[nodiscard]] S start() {
    mark_in_front();
    return cost_now().all;
  }

  void linearise() {
    const auto clear = [](auto& sums) {
      for (auto& sum : sums) std::fill_n(sum.data(), sum.size(), S(0));
    };
    clear(ws_.U), clear(ws_.b_pose);
    clear(ws_.V), clear(ws_.b_point);
    clear(ws_.W);
    for (std::size_t k = 0; k < problem_.observations.size(); ++k) linearise(k);
  }

  [[nodiscard]] bool solve(const S& lambda) {
    reduce_poses(lambda);
    const auto& observations = problem_.observations;
    for (std::size_t first = 0; first < observations.size();) {
      const std::size_t last = end_of_point(first);
      eliminate_point(first, last, lambda);
      first = last;
    }
    ws_.factor.compute(ws_.reduced);
    if (ws_.factor.info() != Eigen::Success) return false;
    ws_.step = ws_.factor.solve(ws_.rhs);
    return all_finite(ws_.step.data(), ws_.step.size());
  }

  [[nodiscard]] S apply() {
    std::copy(problem_.poses.begin(), problem_.poses.end(), ws_.poses.begin());
    std::copy(problem_.points.begin(), problem_.points.end(), ws_.points.begin());
    const auto& observations = problem_.observations;
    for (std::size_t first = 0; first < observations.size();) {
      const std::size_t j = point_of(observations[first]), last = end_of_point(first);
      Vector3 b(-ws_.b_point[j](0), -ws_.b_point[j](1), -ws_.b_point[j](2));
      for (std::size_t k = first; k < last; ++k) {
        const int c = column_of(observations[k]);
        if (c < 0) continue;
        for (int i = 0; i < 3; ++i) b(i) -= dot6(ws_.W[k].data() + 6 * i, ws_.step.data() + 6 * c);
      }
      const Vector3 step = product<S>(ws_.V_inverse[j], b);
      for (int i = 0; i < 3; ++i) problem_.points[j](i) += step(i);
      first = last;
    }
    for (std::size_t i = 0; i < problem_.poses.size(); ++i) {
      if (ws_.column[i] < 0) continue;
      problem_.poses[i] = SE3<S>::exp(Vector6(ws_.step.data() + 6 * ws_.column[i])) * problem_.poses[i];
    }
    trial_ = cost_now();
    return trial_.known;
  }
  S accept(const S&) {
    mark_in_front();
    return trial_.all;
  }
  void restore() {
    std::copy(ws_.poses.begin(), ws_.poses.end(), problem_.poses.begin());
    std::copy(ws_.points.begin(), ws_.points.end(), problem_.points.begin());
  }
  [[nodiscard]] bool converged(bool moved, const S& decrease, const S& cost) const {
    return moved && decrease <= options_.tolerance * cost;
  }

 private:
  using Matrix3 = Eigen::Matrix<S, 3, 3>;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  using Vector6 = Eigen::Matrix<S, 6, 1>;
  using Matrix36 = Eigen::Matrix<S, 3, 6>;
  using Matrix63 = Eigen::Matrix<S, 6, 3>;
  struct Cost {
    S known = S(0);  // of the observations that counted before
    S all = S(0);    // and of those that have come in front, for which the known ones cannot pay
  };

  [[nodiscard]] static std::size_t point_of(const BundleObservation<S>& o) {
    return static_cast<std::size_t>(o.point);
  }
  [[nodiscard]] const SE3<S>& pose_of(const BundleObservation<S>& o) const {
    return problem_.poses[static_cast<std::size_t>(o.pose)];
  }
  [[nodiscard]] int column_of(const BundleObservation<S>& o) const {
    return ws_.column[static_cast<std::size_t>(o.pose)];
  }
  /// One past the last observation of the point that the one at `first` sees.
  [[nodiscard]] std::size_t end_of_point(std::size_t first) const {
    const auto& observations = problem_.observations;
    std::size_t last = first;
    while (last < observations.size() && observations[last].point == observations[first].point) ++last;
    return last;
  }
  [[nodiscard]] S chi2(const BundleObservation<S>& o) const {
    return bundle_chi2(camera_, pose_of(o), problem_.points[point_of(o)], o);
  }

  [[nodiscard]] Cost cost_now() const {
    constexpr S kInfinity = std::numeric_limits<S>::infinity();
    RhoSum<S, Kernel> known(kernel_), unknown(kernel_);
    for (std::size_t k = 0; k < problem_.observations.size(); ++k) {
      const S e = chi2(problem_.observations[k]);
      if (e == kInfinity) {
        if (ws_.in_front[k] == 0) continue;
        return {kInfinity, kInfinity};
      }
      (ws_.in_front[k] != 0 ? known : unknown).add(e);
    }
    return {known.value(), known.value() + unknown.value()};
  }
  void mark_in_front() {
    for (std::size_t k = 0; k < problem_.observations.size(); ++k) {
      if (ws_.in_front[k] == 0 && chi2(problem_.observations[k]) != std::numeric_limits<S>::infinity())
        ws_.in_front[k] = 1;
    }
  }

  void linearise(std::size_t k) {
    const BundleObservation<S>& o = problem_.observations[k];
    const std::size_t j = point_of(o);
    const SE3<S>& T = pose_of(o);
    const PoseObservation<S> single = pose_observation(o, problem_.points[j]);
    Vector3 r;
    Matrix36 J;
    if (!pose_residual(camera_, T, single, r, &J)) return;
    const S weight = kernel_.weight(observation_chi2(single, r));
    const Vector3 information(weight * o.inv_sigma_px2, weight * o.inv_sigma_px2,
                              measures_depth(single) ? weight * o.inv_sigma_z2 : S(0));
    // The left three columns of J are the derivative by the point in the camera frame.
    const Matrix3 J_point = product<S>(Matrix3(J.data()), T.rotation_matrix());
    const Matrix3 weighted = scaled_rows<S>(information, J_point);
    add_transposed_product<S>(J_point, weighted, ws_.V[j]);
    add_transposed_product<S>(weighted, r, ws_.b_point[j]);
    const int c = column_of(o);
    if (c < 0) return;
    const Matrix36 weighted_pose = scaled_rows<S>(information, J);
    add_transposed_product<S>(J, weighted, ws_.W[k]);
    add_transposed_product<S>(J, weighted_pose, ws_.U[static_cast<std::size_t>(c)]);
    add_transposed_product<S>(weighted_pose, r, ws_.b_pose[static_cast<std::size_t>(c)]);
  }

  /// The reduced system before the points are eliminated: blocks of the poses alone.
  void reduce_poses(const S& lambda) {
    std::fill_n(ws_.reduced.data(), ws_.reduced.size(), S(0));
    for (int c = 0; c < free_; ++c) {
      const auto& U = ws_.U[static_cast<std::size_t>(c)];
      for (int j = 0; j < 6; ++j) {
        for (int i = 0; i < 6; ++i) ws_.reduced(6 * c + i, 6 * c + j) = U(i, j);
        ws_.reduced(6 * c + j, 6 * c + j) = U(j, j) + lambda * U(j, j) + std::numeric_limits<S>::min();
        ws_.rhs(6 * c + j) = -ws_.b_pose[static_cast<std::size_t>(c)](j);
      }
    }
  }

  /// Eliminates the point of the observations [first, last). One that no free pose sees keeps its V, so it is
  /// adjusted, too; one without information stays.
  void eliminate_point(std::size_t first, std::size_t last, const S& lambda) {
    const auto& observations = problem_.observations;
    const std::size_t j = point_of(observations[first]);
    const Matrix3 inverse = held_inverse(ws_.V[j], lambda);
    ws_.V_inverse[j] = inverse;
    for (std::size_t a = first; a < last; ++a) {
      const int ca = column_of(observations[a]);
      if (ca < 0) continue;
      Matrix63 Y;
      for (int n = 0; n < 3; ++n) {
        for (int m = 0; m < 6; ++m)
          Y(m, n) = product_at(ws_.W[a], m, inverse(0, n), inverse(1, n), inverse(2, n));
      }
      const Vector3& b_point = ws_.b_point[j];
      for (int m = 0; m < 6; ++m) ws_.rhs(6 * ca + m) += product_at(Y, m, b_point(0), b_point(1), b_point(2));
      for (std::size_t b = first; b < last; ++b) {
        const int cb = column_of(observations[b]);
        if (cb >= 0 && cb <= ca) subtract_block(Y, ws_.W[b], ca, cb);  // the lower triangle
      }
    }
  }

  /// Subtracts Y W^T from block (ca, cb) of the reduced system.
  void subtract_block(const Matrix63& Y, const Matrix63& W, int ca, int cb) {
    for (int n = 0; n < 6; ++n) {
      S* column = ws_.reduced.data() + (6 * cb + n) * ws_.reduced.rows() + 6 * ca;
      for (int m = 0; m < 6; ++m) column[m] -= product_at(Y, m, W(n, 0), W(n, 1), W(n, 2));
    }
  }

  /// Inverse of a point's damped V; zero where it has no information.
  [[nodiscard]] Matrix3 held_inverse(Matrix3 V, const S& lambda) const {
    for (int i = 0; i < 3; ++i) V(i, i) += lambda * V(i, i);
    const S scale = V(0, 0) + (V(1, 1) + V(2, 2));
    if (!(scale > S(0))) return Matrix3::Zero();
    for (int i = 0; i < 3; ++i) V(i, i) += options_.held_depth * scale;
    const Matrix3 C = cofactors<S>(V);
    const S inverse_determinant = S(1) / (C(0, 0) * V(0, 0) + C(1, 0) * V(1, 0) + C(2, 0) * V(2, 0));
    Matrix3 inverse;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) inverse(j, i) = C(i, j) * inverse_determinant;
    }
    return inverse;
  }

  /// Coefficient of row m of A by the vector [x, y, z].
  [[nodiscard]] static S product_at(const Matrix63& A, int m, const S& x, const S& y, const S& z) {
    return A(m, 0) * x + A(m, 1) * y + A(m, 2) * z;
  }

  const Camera& camera_;
  const BundleProblem<S>& problem_;
  const BundleOptions<S>& options_;
  const Kernel& kernel_;
  BundleWorkspace<S>& ws_;
  int free_ = 0;
  Cost trial_;
};

}  // namespace detail

/// Poses and points that minimise the robust reprojection and depth errors (Eqs 5 and 6 over a window
/// of keyframes), by Levenberg-Marquardt. The points are eliminated (Schur complement), which leaves a
/// dense system of six unknowns per free pose; meant for windows of up to some tens of poses.
/// An observation that is behind its camera at the start does not count until a step brings it in front; a
/// step that puts any other one there is refused, or hiding points would be a way to a low cost.
/// @param camera  any camera with a derivative; the observations are its pixels
template <std::floating_point S, DifferentiableCameraOf<S> Camera, RobustKernel<S> Kernel>
BundleResult<S> bundle_adjust(const Camera& camera, const BundleProblem<S>& problem,
                              const BundleOptions<S>& options, const Kernel& kernel,
                              BundleWorkspace<S>& workspace) {
  detail::BundleSolver<S, Camera, Kernel> solver(camera, problem, options, kernel, workspace);
  return minimise<BundleResult<S>, S>(solver, options);
}

/// The same for those who try it once: memory of its own, a t-distribution.
template <std::floating_point S, DifferentiableCameraOf<S> Camera>
BundleResult<S> bundle_adjust(const Camera& camera, const BundleProblem<S>& problem,
                              const BundleOptions<S>& options = {}) {
  BundleWorkspace<S> workspace;
  return bundle_adjust(camera, problem, options, TDistribution<S>::with_dimension(S(5), 1), workspace);
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
