// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/concepts/image.hpp"
#include "dynslam/config.hpp"
#include "dynslam/features/feature.hpp"
#include "dynslam/geometry/ideal_pinhole.hpp"
#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/geometry/rolling_shutter.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/image/depth.hpp"

namespace dynslam {

/// Tells of a recorded pixel what geometry needs of it: the pixel of the ideal pinhole camera, and the depth
/// there at the time of the colour image; both as its middle row would have seen them, where rows are read
/// one after the other.
///
/// The inverse of a lens is looked up: it is calculated once per pixel of the image, and positions between
/// are reached from the nearest one by the steps to its neighbours, for a lens is smooth.
template <HasIdealPinhole C>
  requires std::floating_point<typename C::ScalarType>
class FeaturePlacer {
 public:
  using S = typename C::ScalarType;
  using Vector2 = Eigen::Matrix<S, 2, 1>;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  static constexpr float kNowhere = -1e6F;  ///< ideal pixel of what has none: far outside every image

  /// @param width, height  of the recorded images [px]
  FeaturePlacer(const C& camera, int width, int height)
      : camera_(camera), pinhole_(ideal_pinhole(camera)), width_(width), height_(height) {
    DYNSLAM_ASSERT(width >= 0 && height >= 0, "an image needs non-negative sizes");
    ideal_.reserve(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
    for (int v = 0; v < height; ++v) {
      for (int u = 0; u < width; ++u) {
        const auto x = to_ideal(camera_, pinhole_, Vector2(S(u), S(v)));
        ideal_.push_back(x ? Eigen::Vector2f(x->template cast<float>())
                           : Eigen::Vector2f::Constant(kNowhere));
      }
    }
  }

  [[nodiscard]] const C& camera() const { return camera_; }
  [[nodiscard]] const Pinhole<S>& pinhole() const { return pinhole_; }
  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  /// Whether an ideal pixel lies in an image of this size.
  [[nodiscard]] bool sees(const Feature& f) const {
    return f.x >= 0 && f.y >= 0 && f.x < static_cast<float>(width_) && f.y < static_cast<float>(height_);
  }

  /// Ideal pixels per recorded one at a recorded pixel, as the root of the mean square over all directions:
  /// times as large is the noise of a feature's ideal place as that of its recorded one. 1 outside the
  /// image.
  [[nodiscard]] float stretch(const Vector2& pixel) const {
    const int u = static_cast<int>(std::lrint(pixel.x())), v = static_cast<int>(std::lrint(pixel.y()));
    if (!contains(u, v)) return 1.0F;
    const Steps steps = steps_at(u, v);
    return std::sqrt(0.5F * (steps.right.squaredNorm() + steps.down.squaredNorm()));
  }

  /// The camera's motion from the colour image to the depth image, which are taken one after the other;
  /// nullopt: at once, or it is unknown.
  void set_depth_motion(const std::optional<SE3<S>>& T_depth_c) { T_depth_c_ = T_depth_c; }

  /// How the camera moves while the colour image's rows are read. Depth is read alike, row by row, the
  /// motion of set_depth_motion() earlier or later.
  void set_rolling_shutter(const RollingShutter<S>& shutter) { shutter_ = shutter; }
  [[nodiscard]] const RollingShutter<S>& rolling_shutter() const { return shutter_; }

  /// The recorded pixel of a point in the camera's frame [m], the middle row's: the inverse of place().
  [[nodiscard]] std::optional<Vector2> project(const Vector3& p_c) const {
    return shutter_.project(camera_, p_c);
  }

  /// Puts a feature at a recorded pixel: u, v, x, y and depth are set. A pixel to which the lens has no
  /// inverse, or outside the image, has neither an ideal pixel (kNowhere) nor a depth. Of a feature without
  /// depth the middle row's view is that of something far away.
  template <DepthImage I>
  void place(Feature& f, const Vector2& pixel, const I& depth) const {
    f.u = static_cast<float>(pixel.x());
    f.v = static_cast<float>(pixel.y());
    f.x = f.y = kNowhere;
    f.depth = 0;
    if (!undo_lens(f)) return;
    const int u = static_cast<int>(std::lrint(f.u)), v = static_cast<int>(std::lrint(f.v));
    const auto z = static_cast<float>(depth(u, v));
    if (is_valid_depth(z)) f.depth = T_depth_c_ ? depth_of_colour_time(f, z, depth) : z;
    bring_to_middle(f);
  }

  /// Puts each feature at the recorded pixel (u, v) that it has. Faster than one after the other: what is
  /// looked up lies all over large tables, and is fetched ahead.
  template <DepthImage I>
  void place(std::span<Feature> features, const I& depth) const {
    constexpr std::size_t kAhead = 8;  // features between which memory answers
    for (std::size_t i = 0; i < features.size(); ++i) {
      if (i + kAhead < features.size()) fetch(features[i + kAhead], depth);
      Feature& f = features[i];
      place(f, Vector2(static_cast<S>(f.u), static_cast<S>(f.v)), depth);
    }
  }

  /// Puts a feature that was placed as if all rows were read at once where the middle row would have seen
  /// it.
  void bring_to_middle(Feature& f) const {
    if (!shutter_.moves() || f.x == kNowhere) return;
    constexpr float kFar = 1e4F;  // [m]; the camera's way does not show there
    Feature seen = f;
    if (f.depth <= 0) seen.depth = kFar;
    const Vector3 p = shutter_.to_middle(point(seen), static_cast<S>(f.v));
    const auto x = pinhole_.project(p);
    if (!x) return;
    f.x = static_cast<float>(x->x());
    f.y = static_cast<float>(x->y());
    if (f.depth > 0) f.depth = static_cast<float>(p.z());
  }

  /// Puts a feature that was placed by another motion where the middle row has seen it by the present one.
  /// @param placed_by  that motion
  void place_again(Feature& f, const RollingShutter<S>& placed_by) const {
    f.depth = static_cast<float>(depth_of_row(f, placed_by));
    if (undo_lens(f)) bring_to_middle(f);
  }

  /// A feature's depth when its own row was read [m], as it is for unproject() of its recorded pixel.
  [[nodiscard]] S depth_of_row(const Feature& f) const { return depth_of_row(f, shutter_); }

  /// The point that a feature with depth shows, in the camera's frame [m].
  [[nodiscard]] Vector3 point(const Feature& f) const {
    return pinhole_.ray(Vector2(static_cast<S>(f.x), static_cast<S>(f.y))) * static_cast<S>(f.depth);
  }

 private:
  /// The same of a feature that was placed by some motion.
  [[nodiscard]] S depth_of_row(const Feature& f, const RollingShutter<S>& placed_by) const {
    if (!placed_by.moves() || f.depth <= 0) return static_cast<S>(f.depth);
    return placed_by.to_row(point(f), static_cast<S>(f.v)).z();
  }

  /// Sets the ideal pixel of a feature's recorded one, as if all rows were read at once. @return whether it
  /// has one
  bool undo_lens(Feature& f) const {
    const int u = static_cast<int>(std::lrint(f.u)), v = static_cast<int>(std::lrint(f.v));
    if (!contains(u, v)) return false;
    const Eigen::Vector2f& ideal = ideal_at(u, v);
    const Steps steps = steps_at(u, v);
    const float du = f.u - static_cast<float>(u), dv = f.v - static_cast<float>(v);
    f.x = ideal.x() + du * steps.right.x() + dv * steps.down.x();
    f.y = ideal.y() + dv * steps.down.y() + du * steps.right.y();
    return ideal.x() != kNowhere;
  }

  /// What the ideal pixel changes by with one recorded pixel to the right, and one down.
  struct Steps {
    Eigen::Vector2f right, down;
  };
  [[nodiscard]] Steps steps_at(int u, int v) const { return {step(u, v, 1, 0), step(u, v, 0, 1)}; }
  /// Half of the way between both neighbours; at the border, and at that of the lens' field, to the one
  /// that is there; that of a pinhole where there is none.
  [[nodiscard]] Eigen::Vector2f step(int u, int v, int right, int down) const {
    const auto known = [&](int a, int b) { return contains(a, b) && ideal_at(a, b).x() != kNowhere; };
    const bool here = known(u, v), after = known(u + right, v + down), before = known(u - right, v - down);
    if (!here || !(after || before)) return {static_cast<float>(right), static_cast<float>(down)};
    const Eigen::Vector2f& to = after ? ideal_at(u + right, v + down) : ideal_at(u, v);
    const Eigen::Vector2f& from = before ? ideal_at(u - right, v - down) : ideal_at(u, v);
    const float per_pixel = after && before ? 0.5F : 1.0F;
    return {per_pixel * (to.x() - from.x()), per_pixel * (to.y() - from.y())};
  }

  [[nodiscard]] bool contains(int u, int v) const { return u >= 0 && v >= 0 && u < width_ && v < height_; }

  /// Ideal pixel of a recorded one that is inside the image.
  [[nodiscard]] const Eigen::Vector2f& ideal_at(int u, int v) const {
    return ideal_[static_cast<std::size_t>(v) * static_cast<std::size_t>(width_) +
                  static_cast<std::size_t>(u)];
  }

  /// Has the processor begin to read what place() will ask for.
  template <DepthImage I>
  void fetch(const Feature& f, const I& depth) const {
    const int u = static_cast<int>(std::lrint(f.u)), v = static_cast<int>(std::lrint(f.v));
    if (!contains(u, v)) return;
    for (const int row : {v - 1, v, v + 1}) {
      if (contains(u, row)) detail::prefetch(&ideal_at(u, row));
    }
    if constexpr (RowImage<I>) detail::prefetch(depth.row(v) + u);
  }

  /// The depth image was taken a little earlier or later: looks where the point was then, and brings what
  /// is measured there back. @return 0 where nothing is
  template <DepthImage I>
  [[nodiscard]] float depth_of_colour_time(const Feature& f, float z, const I& depth) const {
    const Vector3 p_c = pinhole_.ray(Vector2(static_cast<S>(f.x), static_cast<S>(f.y))) * static_cast<S>(z);
    const Vector3 p_d = *T_depth_c_ * p_c;
    const auto x_d = camera_.project(p_d);
    if (!x_d) return 0;
    const S kFar = S(1e6);  // a pixel that an integer holds
    if (!(std::abs(x_d->x()) < kFar && std::abs(x_d->y()) < kFar)) return 0;
    const int u = static_cast<int>(std::lround(x_d->x())), v = static_cast<int>(std::lround(x_d->y()));
    if (!contains(u, v)) return 0;
    const auto then = static_cast<float>(depth(u, v));
    if (!is_valid_depth(then)) return 0;
    return static_cast<float>(static_cast<S>(then) + p_c.z() - p_d.z());
  }

  C camera_;
  Pinhole<S> pinhole_;
  int width_, height_;
  std::vector<Eigen::Vector2f> ideal_;  // per recorded pixel
  std::optional<SE3<S>> T_depth_c_;
  RollingShutter<S> shutter_;
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
