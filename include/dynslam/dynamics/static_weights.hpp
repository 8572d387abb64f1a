// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/concepts/image.hpp"
#include "dynslam/config.hpp"
#include "dynslam/dynamics/classify.hpp"
#include "dynslam/dynamics/residuals.hpp"
#include "dynslam/dynamics/static_weight.hpp"
#include "dynslam/geometry/epipolar.hpp"
#include "dynslam/geometry/pixel_ray.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/geometry/two_view.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/robust/t_distribution.hpp"

namespace dynslam {

/// A keypoint of the reference image that was found again. Pixels are those of the images as recorded.
template <std::floating_point S>
struct KeypointMatch {
  Eigen::Matrix<S, 2, 1> x;      ///< in the reference image
  Eigen::Matrix<S, 3, 1> p_ref;  ///< the point in the reference camera's frame [m]
  Eigen::Matrix<S, 2, 1> x_m;    ///< where it was found in the present image
  bool masked = false;           ///< on something that may move (an a-priori mask): not used for F and scales
};

/// A match whose point is measured by the reference depth image; nullopt without a ray or a valid depth [m].
template <CameraModel C>
[[nodiscard]] std::optional<KeypointMatch<typename C::ScalarType>> keypoint_match(
    const C& camera, const Eigen::Matrix<typename C::ScalarType, 2, 1>& x, typename C::ScalarType depth,
    const Eigen::Matrix<typename C::ScalarType, 2, 1>& x_m, bool masked = false) {
  if (!is_valid_depth(depth)) return std::nullopt;
  const auto p_ref = camera.unproject(x, depth);
  if (!p_ref) return std::nullopt;
  return KeypointMatch<typename C::ScalarType>{x, *p_ref, x_m, masked};
}

/// Options of static_weights().
template <std::floating_point S>
struct StaticWeightsOptions {
  S nu = S(5);                 ///< degrees of freedom of the t-distribution
  std::optional<S> numerator;  ///< of Eq (7); empty: nu + d, so that a typical static point has weight 1
  S tau = S(0.25);             ///< weight below which a keypoint is dynamic
  /// Smallest scales: grey values, pixels, sensor standard deviations. With perfect matches the estimate
  /// would go to zero and everything would be an outlier.
  StaticWeightScales<S> floors{S(6), S(0.7), S(2)};
  DepthNoise<S> depth_noise;     ///< of the sensor: the depth error is judged in its standard deviations
  std::size_t min_matches = 30;  ///< outside the mask, for scales and F to mean something
  S epipolar_px = S(1.5);        ///< distance to the epipolar curve that makes a mismatch [recorded px]
  S min_parallax_px = S(4);      ///< median parallax below which F is not estimated [recorded px]
  std::uint64_t seed = 1;        ///< of the RANSAC

  /// Eq (7) as the paper prints it: nu = 11 and the numerator 12 for every d. tau is chosen such that a match
  /// with all three errors is dynamic from the same squared normalised error on as by the default form (27).
  [[nodiscard]] static StaticWeightsOptions paper() {
    StaticWeightsOptions options;
    options.nu = S(11);
    options.numerator = S(12);
    options.tau = S(12) / (S(11) + S(27));
    return options;
  }
};

/// Whether static_weights() could say something.
enum class StaticWeightsStatus : std::uint8_t {
  ok,
  too_few_matches  ///< outside the mask: nothing can be said, and weights and flags are empty
};

/// What became of the epipolar check (Eq 8).
enum class EpipolarVerdict : std::uint8_t {
  not_applicable,  ///< too few matches, too little parallax, or no F that enough of them agree on
  planar,          ///< one homography explains them: F would be arbitrary, and nothing is judged by it
  applied          ///< matches far from their epipolar curve are mismatches
};

/// Weights and flags are in the order of the matches.
template <std::floating_point S>
struct StaticWeightsResult {
  StaticWeightsStatus status = StaticWeightsStatus::too_few_matches;
  std::vector<S> weight;               ///< Eq (7); 0 for mismatches and for invalid ones
  std::vector<std::uint8_t> dynamic;   ///< 1: weight < tau, and neither a mismatch nor invalid
  std::vector<std::uint8_t> mismatch;  ///< 1: off its epipolar curve (Eq 8)
  std::vector<std::uint8_t> invalid;   ///< 1: a pixel or the point is not finite: nothing can be said
  StaticWeightScales<S> scales{};      ///< estimated; depth in the sensor's standard deviations
  S exposure = S(0);                   ///< median photometric error, taken off all of them [grey values]
  EpipolarVerdict epipolar = EpipolarVerdict::not_applicable;
  int mismatches = 0, dynamic_matches = 0, invalid_matches = 0;
  [[nodiscard]] bool ok() const { return status == StaticWeightsStatus::ok; }
};

/// Memory of static_weights; keep it between calls to avoid allocation. The result lives in it.
template <std::floating_point S>
struct StaticWeightsWorkspace {
  StaticWeightsResult<S> result;
  std::vector<KeypointResiduals<S>> residuals;
  std::vector<S> photometric, reprojection, depth, sorted;
  std::vector<PixelRay<double>> x, x_m;
  std::vector<std::size_t> index;
  RansacWorkspace ransac;
  ScaleWorkspace<S> scale;
};

namespace detail {

/// Flags what is not finite. @return how many
template <std::floating_point S>
[[nodiscard]] int flag_invalid(std::span<const KeypointMatch<S>> matches,
                               std::vector<std::uint8_t>& invalid) {
  invalid.assign(matches.size(), 0);
  int count = 0;
  for (std::size_t k = 0; k < matches.size(); ++k) {
    const KeypointMatch<S>& m = matches[k];
    invalid[k] = m.x.allFinite() && m.p_ref.allFinite() && m.x_m.allFinite() ? 0 : 1;
    count += invalid[k];
  }
  return count;
}

/// Eq (8): flags what lies off its epipolar curve. F is estimated outside the a-priori mask only, and only
/// where the translation gives it meaning and the scene is not a plane (two_view_geometry). In rays, and in
/// double whatever S is: eight points of an image are at the limit of what float can tell apart.
template <DifferentiableCamera C, class S = typename C::ScalarType>
void flag_mismatches(const C& camera, std::span<const KeypointMatch<S>> matches, const SE3<S>& T_cur_ref,
                     const StaticWeightsOptions<S>& options, StaticWeightsWorkspace<S>& ws) {
  auto& result = ws.result;
  ws.x.clear();
  ws.x_m.clear();
  ws.index.clear();
  ws.sorted.clear();
  std::size_t n = 0;
  for (const bool masked : {false, true}) {  // what F is estimated from comes first
    for (std::size_t k = 0; k < matches.size(); ++k) {
      const KeypointMatch<S>& m = matches[k];
      if (m.masked != masked || result.invalid[k] != 0) continue;
      // The depth matters where rows are read one after the other; where it is none, any will do.
      const S z = (T_cur_ref * m.p_ref).z();
      const auto p_m = camera.unproject(m.x_m, z > S(0) ? z : S(1));
      if (!p_m) continue;
      const auto x = pixel_ray(camera, m.p_ref), x_m = pixel_ray(camera, *p_m);
      if (!x || !x_m) continue;
      ws.index.push_back(k);
      ws.x.push_back(ray_in_double(*x));
      ws.x_m.push_back(ray_in_double(*x_m));
      const auto rotated = masked ? std::nullopt : camera.project(T_cur_ref.so3() * m.p_ref);
      if (rotated) ws.sorted.push_back((*rotated - m.x_m).norm());
    }
    if (!masked) n = ws.x.size();
  }
  if (n < options.min_matches || baseline_of(ws.sorted, options.min_parallax_px) != Baseline::sufficient)
    return;
  using Rays = std::span<const PixelRay<double>>;
  TwoViewOptions<double> two_view;
  // Static surfaces a little off F still count, or it fits a moving object beside a wall to the last digit.
  const double epipolar_px = static_cast<double>(options.epipolar_px);
  two_view.ransac.threshold_px = 2 * epipolar_px;
  two_view.ransac.seed = options.seed;
  const auto views = model_of_rays(Rays(ws.x).first(n), Rays(ws.x_m).first(n), two_view, ws.ransac);
  if (views.model == TwoViewModel::homography) result.epipolar = EpipolarVerdict::planar;
  if (views.model != TwoViewModel::fundamental) return;
  result.epipolar = EpipolarVerdict::applied;
  for (std::size_t i = 0; i < ws.x.size(); ++i) {
    if (views.distance(ws.x[i], ws.x_m[i]) <= epipolar_px) continue;
    result.mismatch[ws.index[i]] = 1;
    ++result.mismatches;
  }
}

/// Eqs (3), (5) and (6) of all matches; those that may tell the scales are also collected.
template <DifferentiableCamera C, ImageLike A, ImageLike B, DepthImage D, class S = typename C::ScalarType>
void collect_residuals(const C& camera, std::span<const KeypointMatch<S>> matches, const A& reference_gray,
                       const B& gray, const D& depth, const SE3<S>& T_cur_ref,
                       const StaticWeightsOptions<S>& options, StaticWeightsWorkspace<S>& ws) {
  ws.residuals.assign(matches.size(), {});
  for (auto* values : {&ws.photometric, &ws.reprojection, &ws.depth}) values->clear();
  for (std::size_t k = 0; k < matches.size(); ++k) {
    const KeypointMatch<S>& m = matches[k];
    KeypointResiduals<S>& r = ws.residuals[k];
    if (ws.result.invalid[k] != 0) continue;
    const Eigen::Matrix<S, 3, 1> p_c = T_cur_ref * m.p_ref;
    const auto projected = camera.project(p_c);
    if (!projected) {  // found again, though it would have to be out of view: it moves
      r.reprojection = std::numeric_limits<S>::infinity();
      continue;
    }
    r.reprojection = reprojection_residual(*projected, m.x_m);
    r.photometric = photometric_residual(reference_gray, m.x, gray, *projected);
    r.depth = depth_residual(p_c, depth, m.x_m);
    if constexpr (requires { camera.depth_at_middle(m.x_m, S(1)); }) {  // RollingCamera
      if (r.depth && camera.moves()) r.depth = p_c.z() - camera.depth_at_middle(m.x_m, p_c.z() - *r.depth);
    }
    if (m.masked || ws.result.mismatch[k] != 0) continue;
    if (r.photometric) ws.photometric.push_back(*r.photometric);
    ws.reprojection.push_back(r.reprojection);
    if (r.depth) ws.depth.push_back(*r.depth / options.depth_noise.sigma(p_c.z()));
  }
}

/// Exposure differs between two images: the median photometric error is not a residual. Takes it off.
template <std::floating_point S>
[[nodiscard]] S take_off_exposure(std::vector<S>& photometric, std::vector<S>& sorted) {
  if (photometric.empty()) return S(0);
  sorted = photometric;
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  const S median = *middle;
  for (S& e : photometric) e -= median;
  return median;
}

}  // namespace detail

/// Static weights of the keypoints of one reference image in the present one (paper, steps 6 to 8):
/// mismatches by the epipolar constraint (Eq 8), photometric, reprojection and depth error of each match (Eqs
/// 3, 5, 6), their scales estimated outside the a-priori mask with floors, exposure compensated, joint weight
/// (Eq 7) and verdict. Pixels and thresholds in them are those of the recorded images; the camera may have
/// any lens. Matches that are not finite have weight 0 and a flag of their own, and change nothing for the
/// others.
/// @param reference_gray, gray  grey images, 0 to 255, of any type that is ImageLike
/// @param depth      present depth image [m]; invalid = NaN or <= 0
/// @param T_cur_ref  pose of the reference camera in the present one's frame, as known before the check
/// @return reference to workspace.result; status too_few_matches without enough matches outside the mask
template <DifferentiableCamera C, ImageLike A, ImageLike B, DepthImage D, class S = typename C::ScalarType>
DYNSLAM_NO_DANGLING const StaticWeightsResult<S>& static_weights(
    const C& camera, std::type_identity_t<std::span<const KeypointMatch<S>>> matches, const A& reference_gray,
    const B& gray, const D& depth, const SE3<S>& T_cur_ref, const StaticWeightsOptions<S>& options,
    StaticWeightsWorkspace<S>& workspace) {
  auto& result = workspace.result;
  const std::size_t n = matches.size();
  result.status = StaticWeightsStatus::too_few_matches;
  result.epipolar = EpipolarVerdict::not_applicable;
  result.mismatches = result.dynamic_matches = 0;
  result.scales = options.floors;
  result.exposure = S(0);
  result.mismatch.assign(n, 0);
  result.invalid_matches = detail::flag_invalid<S>(matches, result.invalid);
  result.weight.clear();
  result.dynamic.clear();
  detail::flag_mismatches(camera, matches, T_cur_ref, options, workspace);
  detail::collect_residuals(camera, matches, reference_gray, gray, depth, T_cur_ref, options, workspace);
  if (workspace.reprojection.size() < options.min_matches) {
    result.mismatch.clear();
    result.invalid.clear();
    return result;
  }
  result.exposure = detail::take_off_exposure(workspace.photometric, workspace.sorted);
  ScaleOptions<S> scale_options;
  scale_options.nu = options.nu;
  const auto scale_of = [&](const std::vector<S>& values, S floor) {
    const auto sigma = estimate_scale<S>(std::span<const S>(values), {}, scale_options, workspace.scale);
    return sigma ? std::max(floor, *sigma) : floor;
  };
  result.scales = {scale_of(workspace.photometric, options.floors.photometric),
                   scale_of(workspace.reprojection, options.floors.reprojection),
                   scale_of(workspace.depth, options.floors.depth)};
  result.weight.assign(n, S(0));
  result.dynamic.assign(n, 0);
  for (std::size_t k = 0; k < n; ++k) {
    if (result.mismatch[k] != 0 || result.invalid[k] != 0) continue;
    KeypointResiduals<S>& r = workspace.residuals[k];
    if (r.photometric) *r.photometric -= result.exposure;
    const S z = (T_cur_ref * matches[k].p_ref).z();
    const StaticWeightScales<S> scales{result.scales.photometric, result.scales.reprojection,
                                       result.scales.depth * options.depth_noise.sigma(z)};
    const auto distribution = TDistribution<S>::with_numerator(
        options.nu, options.numerator.value_or(options.nu + S(r.dimension())));
    result.weight[k] = static_weight<S>(r, scales, distribution);
    result.dynamic[k] = is_dynamic(result.weight[k], options.tau) ? 1 : 0;
    result.dynamic_matches += result.dynamic[k];
  }
  result.status = StaticWeightsStatus::ok;
  return result;
}

/// The same without a workspace, for those who try it once.
template <DifferentiableCamera C, ImageLike A, ImageLike B, DepthImage D, class S = typename C::ScalarType>
[[nodiscard]] StaticWeightsResult<S> static_weights(
    const C& camera, std::type_identity_t<std::span<const KeypointMatch<S>>> matches, const A& reference_gray,
    const B& gray, const D& depth, const SE3<S>& T_cur_ref, const StaticWeightsOptions<S>& options = {}) {
  StaticWeightsWorkspace<S> workspace;
  static_weights(camera, matches, reference_gray, gray, depth, T_cur_ref, options, workspace);
  return std::move(workspace.result);
}

}  // namespace dynslam

#include "dynslam/dynamics/static_weights_instances.hpp"

#include "dynslam/pop_macros.hpp"
