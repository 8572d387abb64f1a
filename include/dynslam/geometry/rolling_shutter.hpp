// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <concepts>
#include <optional>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/concepts/scalar.hpp"
#include "dynslam/config.hpp"

namespace dynslam {

/// A camera that moves while it reads its image row by row. Each row has a pose of its own then; this brings
/// points from one to another, where "the pose of the image" is that of its middle row.
///
/// The camera moves evenly while it reads: row poses are exp(share motion), by a series that is exact to
/// 1e-6 of the distance up to a turn of 1 rad between the middle row and the one asked for.
template <Scalar S>
class RollingShutter {
 public:
  using Vector2 = Eigen::Matrix<S, 2, 1>;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  using Vector6 = Eigen::Matrix<S, 6, 1>;

  /// All rows at once (a global shutter), or a camera at rest.
  RollingShutter() = default;
  /// @param motion  from the first row to the last, as SE3::log() of T_last_first [m, rad]
  /// @param height  rows of the image, at least 2 (asserted)
  RollingShutter(const Vector6& motion, int height)
      : upsilon_(motion[0], motion[1], motion[2]),
        omega_(motion[3], motion[4], motion[5]),
        turn2_(omega_.squaredNorm()),
        middle_(S(height - 1) / S(2)),
        per_row_(S(1) / S(height - 1)),
        moves_(true) {
    DYNSLAM_ASSERT(height >= 2, "an image that is read row by row needs two rows");
  }

  /// Whether rows differ.
  [[nodiscard]] bool moves() const { return moves_; }
  /// From the first row to the last: p' = p + omega x p + upsilon to first order [m, rad].
  [[nodiscard]] const Vector3& upsilon() const { return upsilon_; }
  [[nodiscard]] const Vector3& omega() const { return omega_; }

  /// The same camera, turned by so much more from the first row to the last [rad].
  [[nodiscard]] RollingShutter turned(const Vector3& turn) const {
    RollingShutter result = *this;
    result.omega_ += turn;
    result.turn2_ = result.omega_.squaredNorm();
    return result;
  }
  /// Row `v`, counted from the middle one, as a share of all: -0.5 to 0.5; 0 where all are read at once.
  [[nodiscard]] S share(const S& v) const { return (v - middle_) * per_row_; }

  /// A point in the camera's frame when it read row `v`, in its frame when it read the middle row.
  [[nodiscard]] Vector3 to_middle(const Vector3& p_row, const S& v) const {
    return moves_ ? moved(p_row, (middle_ - v) * per_row_) : p_row;
  }
  /// A point in the camera's frame when it read the middle row, in its frame when it read row `v`.
  [[nodiscard]] Vector3 to_row(const Vector3& p_middle, const S& v) const {
    return moves_ ? moved(p_middle, share(v)) : p_middle;
  }

  /// A direction in the frame of row `v`, in that of the middle row.
  [[nodiscard]] Vector3 turned_to_middle(const Vector3& d_row, const S& v) const {
    if (!moves_) return d_row;
    const S back = (middle_ - v) * per_row_;
    return by_series(d_row, omega_.cross(d_row), back);
  }
  /// How a point moves in the camera's frame per row, where it is when row `v` is read: d to_row() / d v.
  [[nodiscard]] Vector3 per_row(const Vector3& p_row) const {
    return per_row_ * (omega_.cross(p_row) + upsilon_);
  }

  /// The pixel that shows a point: it lies in the row that sees it there, v = y(project(to_row(p, v))).
  ///
  /// Secant steps where the point moves over the image at less than half of the rows' pace, as it does but in
  /// jerks: three to five projections. Otherwise the rows of the image are searched for a change of sign; the
  /// first that sees the point is taken. A pixel outside the image is the one that more rows would have.
  /// @param p_middle  in the camera's frame when it read the middle row [m]
  /// @return  good to 2e-3 px, in floats to 4e-6 of the height; nullopt where no row sees the point. Two rows
  ///          closer than 1/64 of the height that both see it may be overlooked
  template <CameraOf<S> C>
  [[nodiscard]] std::optional<Vector2> project(const C& camera, const Vector3& p_middle) const {
    const std::optional<Vector2> x = camera.project(p_middle);
    if (!moves_) return x;
    Sight sight;
    if (x) sight = by_secants(camera, p_middle, x->y());
    if (!sight.ok && (x || seen(camera, p_middle, S(0)).ok || seen(camera, p_middle, last_row()).ok))
      sight = by_search(camera, p_middle);
    if (!sight.ok) return std::nullopt;
    if constexpr (!std::floating_point<S>) sight = with_derivatives(camera, p_middle, sight);
    return sight.x;
  }

 private:
  /// exp(share motion) p.
  [[nodiscard]] Vector3 moved(const Vector3& p, const S& share) const {
    return by_series(p, omega_.cross(p) + upsilon_, share);
  }
  /// p + V(share omega) (share speed), the exponential of se(3) written by its speed at p:
  /// V(w) = I + (1 - cos |w|) / |w|^2 hat(w) + (|w| - sin |w|) / |w|^3 hat(w)^2.
  [[nodiscard]] Vector3 by_series(const Vector3& p, const Vector3& speed, const S& share) const {
    const S t = turn2_ * share * share;
    const S second = S(1) / S(2) - t * (S(1) / S(24) - t * (S(1) / S(720)));
    const S third = S(1) / S(6) - t * (S(1) / S(120) - t * (S(1) / S(5040)));
    const Vector3 first = share * speed, twice = share * omega_.cross(first);
    return p + first + second * twice + (third * share) * omega_.cross(twice);
  }

  [[nodiscard]] S last_row() const { return S(2) * middle_; }
  /// How far a row may be from what it sees [px]: a tenth of what is promised of the pixel, or rounding.
  [[nodiscard]] S tolerance() const {
    return S(std::max(1e-4, to_double(S(32) * Eigen::NumTraits<S>::epsilon() * last_row())));
  }

  /// What a row sees of a point.
  struct Sight {
    S v = S(0);                                          ///< the row
    Vector2 x = Vector2::Zero();                         ///< where it would see the point
    bool ok = false;                                     ///< whether it does
    [[nodiscard]] S below() const { return x.y() - v; }  ///< how far below itself [px]
  };
  template <class C>
  [[nodiscard]] Sight seen(const C& camera, const Vector3& p_middle, const S& v) const {
    Sight sight{v, Vector2::Zero(), false};
    if (const auto x = camera.project(to_row(p_middle, v))) {
      sight.x = *x;
      sight.ok = true;
    }
    return sight;
  }
  [[nodiscard]] bool solves(const Sight& sight) const {
    using std::abs;
    return !(tolerance() < abs(sight.below()));
  }

  /// @param y  where the middle row sees the point
  /// @return  not ok where the point moves too fast over the image, or leaves it
  template <class C>
  [[nodiscard]] Sight by_secants(const C& camera, const Vector3& p_middle, S y) const {
    using std::abs;
    constexpr int kSteps = 8;    // 2 or 3 in a hand's turns
    const S slow = S(1) / S(2);  // rows per row: below, each step comes nearer, and there is one solution
    S last = middle_, v = y;
    for (int i = 0; i < kSteps; ++i) {
      const Sight now = seen(camera, p_middle, v);
      if (!now.ok) break;
      const S way = v - last;
      const S slope = S(0) < abs(way) ? S((now.x.y() - y) / way) : S(0);
      if (!(abs(slope) < slow)) break;
      if (solves(now)) return now;
      last = v;
      y = now.x.y();
      v += now.below() / (S(1) - slope);
    }
    return {};
  }

  /// The first row of the image that sees a point.
  template <class C>
  [[nodiscard]] Sight by_search(const C& camera, const Vector3& p_middle) const {
    constexpr int kIntervals = 64;
    const S first = -tolerance(), step = (last_row() - S(2) * first) / S(kIntervals);
    Sight low = seen(camera, p_middle, first);
    for (int i = 1; i <= kIntervals; ++i) {
      const Sight high = seen(camera, p_middle, first + S(i) * step);
      Sight a = low, b = high;
      if (a.ok && !b.ok) b = border(camera, p_middle, a, b.v);
      if (b.ok && !a.ok) a = border(camera, p_middle, b, a.v);
      if (a.ok && b.ok) {
        const Sight sight = between(camera, p_middle, a, b);
        if (sight.ok) return sight;
      }
      low = high;
    }
    return {};
  }
  /// The last row on the way from one that sees a point to one that does not which sees it, too.
  template <class C>
  [[nodiscard]] Sight border(const C& camera, const Vector3& p_middle, Sight inside, S outside) const {
    constexpr int kHalvings = 8;
    for (int i = 0; i < kHalvings; ++i) {
      const Sight sight = seen(camera, p_middle, (inside.v + outside) / S(2));
      if (sight.ok) {
        inside = sight;
      } else {
        outside = sight.v;
      }
    }
    return inside;
  }
  /// By bisection; not ok where the point is on the same side of both rows.
  template <class C>
  [[nodiscard]] Sight between(const C& camera, const Vector3& p_middle, const Sight& a,
                              const Sight& b) const {
    using std::abs;
    const bool above = a.below() < S(0);
    if (above == (b.below() < S(0))) return {};
    // To a bracket of the row: where the point keeps pace with the rows, a small miss does not say that the
    // row is near.
    const S narrow = tolerance() / S(8);
    S low = a.v, high = b.v;
    while (narrow < abs(high - low)) {
      const Sight sight = seen(camera, p_middle, (low + high) / S(2));
      if (!sight.ok) return {};
      ((sight.below() < S(0)) == above ? low : high) = sight.v;
    }
    const Sight sight = seen(camera, p_middle, low);
    return sight.ok && solves(sight) ? sight : Sight();  // else a jump of the projection
  }

  /// A solution of dual numbers: Newton steps with the slope by a central difference, whose error in the
  /// derivatives they square.
  template <class C>
  [[nodiscard]] Sight with_derivatives(const C& camera, const Vector3& p_middle, Sight now) const {
    const S half = S(1) / S(2);
    for (int i = 0; i < 2; ++i) {
      const Sight before = seen(camera, p_middle, now.v - half), after = seen(camera, p_middle, now.v + half);
      if (!before.ok || !after.ok) return now;
      const S slope = after.below() - before.below();
      const Sight next = seen(camera, p_middle, now.v - now.below() / slope);
      if (!next.ok) return now;
      now = next;
    }
    return now;
  }

  Vector3 upsilon_ = Vector3::Zero(), omega_ = Vector3::Zero();
  S turn2_ = S(0);  // of omega_
  S middle_ = S(0), per_row_ = S(0);
  bool moves_ = false;
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
