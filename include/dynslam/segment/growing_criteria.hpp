// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cmath>
#include <concepts>

#include "dynslam/concepts/image.hpp"
#include "dynslam/segment/detail/depth_lanes.hpp"

namespace dynslam {

/// A pixel between which and a neighbour growing asks for a way; (u, v) is where a criterion finds its own
/// images: labels, normals, colours.
template <std::floating_point S>
struct GrowingSite {
  int u, v;
  S depth;  ///< along the optical axis [m]
};

/// Decides from the depths of two neighbouring pixels [m].
template <class C, class S>
concept DepthCriterion = requires(const C& criterion, S from, S to) {
  { criterion(from, to) } -> std::convertible_to<bool>;
};
/// Decides from two neighbouring pixels and whatever it knows of them.
template <class C, class S>
concept SiteCriterion = requires(const C& criterion, const GrowingSite<S>& from, const GrowingSite<S>& to) {
  { criterion(from, to) } -> std::convertible_to<bool>;
};
/// Decides whether growing may step from one pixel to a neighbour. It must be symmetric, or the result
/// depends on the order of the seeds.
template <class C, class S>
concept GrowingCriterion = DepthCriterion<C, S> || SiteCriterion<C, S>;

/// A criterion by depths that may be asked about several pairs at once, which is faster: `lanes(from, to)`
/// takes what calculates and compares as numbers do, vectors or numbers, and gives what a comparison of them
/// gives. Here depths may be invalid ones; from or to NaN and infinity there is no step.
template <class C, class S>
concept LaneCriterion = DepthCriterion<C, S> &&
    requires(const C& criterion, const typename detail::DepthLanes<S>::Vector& z) {
  { criterion.lanes(z, z) } -> std::convertible_to<typename detail::DepthLanes<S>::Mask>;
};

/// One that steps only between depths that differ by less than `largest_step()` [m], whatever they are. That
/// steps lead from a depth to a nearby pixel then says that the depth there is valid, too, which is cheaper
/// than a look at each.
template <class C, class S>
concept BoundedLaneCriterion = LaneCriterion<C, S> && requires(const C& criterion) {
  { criterion.largest_step() } -> std::convertible_to<S>;
};

/// The answer of either kind of criterion.
template <std::floating_point S, GrowingCriterion<S> C>
[[nodiscard]] bool may_step(const C& criterion, const GrowingSite<S>& from, const GrowingSite<S>& to) {
  if constexpr (DepthCriterion<C, S>) {
    return criterion(from.depth, to.depth);
  } else {
    return criterion(from, to);
  }
}

/// The paper's: a constant depth step [m]. On real depth it floods through the floor; kept for comparison.
template <std::floating_point S>
struct FixedStep {
  S step = S(0.05);
  [[nodiscard]] bool operator()(S from, S to) const { return lanes(from, to); }
  template <class V>
  [[nodiscard]] auto lanes(const V& from, const V& to) const {
    return detail::magnitude<V>(to - from) < step;
  }
  [[nodiscard]] S largest_step() const { return step; }
};

/// A step that grows with the sensor's noise: |dz| < base + quad * z^2, z being the smaller depth.
template <std::floating_point S>
struct RelativeStep {
  S base = S(0.02);   ///< [m]
  S quad = S(0.005);  ///< [1/m]
  [[nodiscard]] bool operator()(S from, S to) const { return lanes(from, to); }
  template <class V>
  [[nodiscard]] auto lanes(const V& from, const V& to) const {
    const V z = detail::smaller(from, to);
    return detail::magnitude<V>(to - from) < base + quad * z * z;
  }
};

/// Within one label, where a step of depth allows it, too. Refers to the images; they need the size of the
/// depth.
template <LabelImage Labels, class Step>
class SameLabelStep {
 public:
  SameLabelStep(const Labels& labels, const Step& step) : labels_(&labels), step_(step) {}
  SameLabelStep(const Labels&& labels, const Step& step) = delete;
  template <std::floating_point S>
    requires GrowingCriterion<Step, S>
  [[nodiscard]] bool operator()(const GrowingSite<S>& from, const GrowingSite<S>& to) const {
    return (*labels_)(from.u, from.v) == (*labels_)(to.u, to.v) && may_step(step_, from, to);
  }

 private:
  const Labels* labels_;
  Step step_;
};

/// A smooth surface: normals differ by less than an angle, where a step of depth allows it, too. It stops
/// where a person's feet meet the floor, which depth alone does not show. Where a normal is NaN the depth
/// decides.
/// @tparam Normals  an image of unit vectors, as surface_normals() makes it; referred to, size of the depth
template <ImageLike Normals, class Step>
class SmoothSurfaceStep {
 public:
  using Scalar = typename Normals::Pixel::Scalar;
  /// @param max_angle  between neighbouring normals [rad], at most pi
  SmoothSurfaceStep(const Normals& normals, Scalar max_angle, const Step& step)
      : normals_(&normals), min_cosine_(std::cos(max_angle)), step_(step) {}
  SmoothSurfaceStep(const Normals&& normals, Scalar max_angle, const Step& step) = delete;
  template <std::floating_point S>
    requires GrowingCriterion<Step, S>
  [[nodiscard]] bool operator()(const GrowingSite<S>& from, const GrowingSite<S>& to) const {
    if (!may_step(step_, from, to)) return false;
    const Scalar cosine = (*normals_)(from.u, from.v).dot((*normals_)(to.u, to.v));
    return !(cosine < min_cosine_);
  }

 private:
  const Normals* normals_;
  Scalar min_cosine_;
  Step step_;
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
