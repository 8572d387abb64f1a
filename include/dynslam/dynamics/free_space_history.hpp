// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>
#include <utility>
#include <vector>

#include "dynslam/config.hpp"
#include "dynslam/dynamics/depth_grid.hpp"
#include "dynslam/dynamics/free_space.hpp"
#include "dynslam/dynamics/motion_evidence.hpp"
#include "dynslam/geometry/rolling_shutter.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/image/depth_bounds.hpp"
#include "dynslam/image/image.hpp"

namespace dynslam {

/// Remembers reduced depth images with their poses and tells which surfaces of a new one lie in space that
/// was seen to be free (they moved) or were there already (they are static): Eq (6) made dense and signed,
/// over several ages.
///
/// Ages are differences of time stamps. After a gap longer than all `lags` the last view before it is
/// compared.
template <std::floating_point S>
class FreeSpaceHistory {
 public:
  explicit FreeSpaceHistory(const FreeSpaceOptions& options = {}) : options_(options) {}

  [[nodiscard]] const FreeSpaceOptions& options() const { return options_; }
  [[nodiscard]] std::size_t size() const { return views_.size(); }

  /// Compares the cells of a frame at T_c_w with earlier views.
  /// @param depth, smooth  as DepthGrid::reduce makes them
  /// @param t        of the frame, later than those remembered [s]
  /// @param shutter  how the camera moved while the rows of the depth image were read
  void check(const DepthGrid& grid, const Image<float>& depth, const Image<std::uint8_t>& smooth, double t,
             const SE3<S>& T_c_w, MotionEvidence& out, const RollingShutter<S>& shutter = {}) {
    now_ = t;
    shutter_ = GridShutter(shutter, grid.height());
    const std::size_t cells = grid.cells();
    ratio_.assign(cells, 0);
    seen_.assign(cells, 0);
    violations_.assign(cells, 0);
    support_.assign(cells, 0);
    out.clear(grid.width(), grid.height(), options_.prior, options_.unseen);
    shift_ = shift(grid, T_c_w);
    find_surfaces(depth, smooth);
    std::size_t next = 0;  // view that was not yet compared
    for (const double lag : options_.lags) {
      const std::size_t view = nearest_view(lag);
      if (view < next || view == views_.size()) continue;
      compare(grid, depth, T_c_w, view, out.belief);
      next = view + 1;
    }
    find_bounds(depth);
    checked_ = true;
    next = 0;
    for (const double lag : {options_.follow_lag, options_.old_lag}) {
      const std::size_t view = nearest_view(lag);
      if (view < next || view == views_.size()) continue;
      find_gone(grid, T_c_w, views_[view], out.gone);
      next = view + 1;
    }
    for (std::size_t c = 0; c < cells; ++c) {
      if (seen_[c] == 0) continue;
      out.add(c, std::clamp(ratio_[c], -options_.bound, options_.bound));
      out.fresh.data()[c] = violations_[c] > support_[c] ? 1 : 0;
      out.rested.data()[c] = support_[c] > violations_[c] ? 1 : 0;
    }
  }

  /// Keeps the frame last checked, with the log-odds of motion of its cells, as evidence for later ones. Call
  /// it once per frame, in order. Frames that come much faster than the first of `lags` asks for are left
  /// out, which bounds memory.
  /// @param t  of the frame, later than those remembered [s]
  void remember(const Image<float>& depth, double t, const SE3<S>& T_c_w, const Image<float>& belief) {
    last_ = {t, T_c_w};
    if (!views_.empty() && t - views_.front().t < kDensest * options_.lags.front()) return;
    View view;
    if (!spare_.empty()) {
      view = std::move(spare_.back());
      spare_.pop_back();
    }
    if (!std::exchange(checked_, false)) {  // a frame that was not asked about
      find_bounds(depth);
      surface_.resize(0, 0);
    }
    std::swap(view.bounds, bounds_);
    view.shifted = shift_ > 1;
    if (view.shifted) std::swap(view.anywhere, anywhere_);
    view.depth = depth;
    view.surface = surface_;
    view.t = t;
    view.T_c_w = T_c_w;
    view.shutter = shutter_;
    view.belief = belief;
    views_.push_front(std::move(view));
    drop_unused();
  }

  /// Moves the remembered frames with a correction of the map: new T_c_w = old T_c_w D.
  void follow(const SE3<S>& D) {
    for (View& view : views_) view.T_c_w = view.T_c_w * D;
    last_.T_c_w = last_.T_c_w * D;
  }

  void clear() {
    for (View& view : views_) spare_.push_back(std::move(view));
    views_.clear();
  }

 private:
  /// A rolling shutter over the rows of the grid.
  struct GridShutter {
    Eigen::Vector3f upsilon = Eigen::Vector3f::Zero(), omega = Eigen::Vector3f::Zero();
    float per_row = 0, middle = 0;
    bool moves = false;
    GridShutter() = default;
    GridShutter(const RollingShutter<S>& shutter, int rows)
        : upsilon(shutter.upsilon().template cast<float>()),
          omega(shutter.omega().template cast<float>()),
          per_row(1.0F / static_cast<float>(rows)),
          middle(0.5F * static_cast<float>(rows)),
          moves(shutter.moves()) {}
  };

  struct View {
    DepthBounds<float> bounds, anywhere;  // anywhere: within `shift_`, where that is more
    bool shifted = false;
    Image<std::uint8_t> surface;
    Image<float> depth, belief;
    GridShutter shutter;
    double t = 0;
    SE3<S> T_c_w;
  };

  struct Moment {
    double t = 0;
    SE3<S> T_c_w;
  };

  /// Least time between remembered views, as a share of the first lag: four of them may lie within it.
  static constexpr double kDensest = 0.25;

  /// The view whose age is nearest to `lag`; views_.size(): there is none.
  [[nodiscard]] std::size_t nearest_view(double lag) const {
    const auto it = std::partition_point(views_.begin(), views_.end(),
                                         [&](const View& view) { return now_ - view.t < lag; });
    const auto i = static_cast<std::size_t>(it - views_.begin());
    if (i == 0 || views_.empty()) return i;
    if (i == views_.size()) return i - 1;
    return lag - (now_ - views_[i - 1].t) < now_ - views_[i].t - lag ? i - 1 : i;
  }

  /// Ages for which a view stands, half way to the nearer neighbour.
  struct Ages {
    double least, most;
  };
  [[nodiscard]] Ages ages_of(std::size_t view) const {
    const double t = views_[view].t, age = now_ - t;
    double spacing = view == 0 ? age : views_[view - 1].t - t;
    if (view + 1 < views_.size()) spacing = std::min(spacing, t - views_[view + 1].t);
    return {age - 0.5 * spacing, age + 0.5 * spacing};
  }

  /// Drops views that will never be nearest to a lag again: the next newer one is as near to the longest.
  void drop_unused() {
    const double t = views_.front().t, longest = options_.lags.back();
    while (views_.size() > 1) {
      const double oldest = t - views_.back().t, next = t - views_[views_.size() - 2].t;
      if (std::abs(next - longest) > std::abs(oldest - longest)) return;
      spare_.push_back(std::move(views_.back()));
      views_.pop_back();
    }
  }

  /// Greatest shift of the depth image beside its pose [cells]: of a point 1 m ahead in the time that is not
  /// known.
  [[nodiscard]] int shift(const DepthGrid& grid, const SE3<S>& T_c_w) const {
    if (views_.empty()) return 0;
    const SE3<S> step = T_c_w * last_.T_c_w.inverse();
    const S cells = (step.translation().norm() + step.so3().log().norm()) * S(grid.fx());
    const double unknown = (shutter_.moves ? 0.5 : 1.0) * options_.depth_time_uncertainty / (now_ - last_.t);
    return static_cast<int>(std::lround(std::min(S(options_.max_shift), S(unknown) * cells)));
  }

  void find_bounds(const Image<float>& depth) {
    bounds_.compute(depth.view());
    if (shift_ > 1) anywhere_.compute(depth.view(), 5, shift_);
  }

  /// Cells that lie on one surface, as far as that is known: beside something farther, a cell may show that.
  void find_surfaces(const Image<float>& depth, const Image<std::uint8_t>& smooth) {
    surface_ = smooth;
    if (shift_ == 0) return;
    beside_.compute(depth.view(), 1, shift_);
    for (std::size_t c = 0; c < violations_.size(); ++c) {
      const float z = depth.data()[c], farthest = beside_.farthest.data()[c];
      if (farthest - z > rim(z)) surface_.data()[c] = 0;
    }
  }

  /// Adds what a view says of the cells, and the belief that it has of their surfaces.
  void compare(const DepthGrid& grid, const Image<float>& depth, const SE3<S>& T_c_w, std::size_t index,
               Image<float>& belief) {
    constexpr std::size_t kBlock = 64;  // cells whose places are found at once
    std::array<int, kBlock> cell;
    std::array<float, kBlock> z;
    const std::size_t cells = grid.cells();
    const View& view = views_[index];
    const Ages stands_for = ages_of(index);
    const bool shows_motion = stands_for.least > options_.lags.front();
    const double old_lag =
        std::min(options_.old_lag, now_ - views_.back().t);  // a young sequence has nothing older
    const bool is_old = shows_motion && stands_for.most >= old_lag;
    const bool shows_rest = is_old && stands_for.most >= options_.rest_lag;
    const bool passes_belief_on = index == 0 || stands_for.least <= options_.follow_lag;
    const auto keeps = static_cast<float>(std::exp(-(now_ - view.t) / options_.memory));
    const SE3<S> T_v_c = view.T_c_w * T_c_w.inverse();
    const float* nearest = view.bounds.nearest.data();
    const float* farthest = view.bounds.farthest.data();
    const float* then = view.belief.data();
    for (std::size_t c = 0; c < cells; ++c) {
      const std::size_t b = c % kBlock;
      if (b == 0) {
        const std::size_t n = std::min(kBlock, cells - c);
        const auto find = finder(view);
        (this->*find)(grid, depth, T_v_c, shutter_, view.shutter, c, std::span(cell).first(n),
                      std::span(z).first(n));
      }
      if (cell[b] < 0) continue;
      const auto q = static_cast<std::size_t>(cell[b]);
      switch (free_space_evidence(z[b], nearest[q], farthest[q], options_.margins)) {
        case DepthEvidence::violation:
          // What may have been in front at that moment is no free space; nor does it tell of rest.
          if (surface_.data()[c] != 0 && shows_motion && passes(view, q, z[b])) {
            ++violations_[c];
            ratio_[c] += options_.violated;
            seen_[c] = std::max<std::uint8_t>(seen_[c], 1);
          }
          break;
        case DepthEvidence::consistent: {
          // What lies behind a mover's rim is not the mover, though the rim's cell had both depths.
          const bool same = z[b] <= nearest[q] + rim(z[b]);
          if (passes_belief_on && seen_[c] < 2 && same) {
            belief.data()[c] += (then[q] - options_.prior) * keeps;
            seen_[c] = 2;
          }
          // A mover overlaps with where it was shortly before. What has stayed long is at rest, unless it was
          // gone meanwhile: a younger view, which came before this one, had free space there.
          const bool stayed = shows_rest && violations_[c] == 0;
          const float moved = stayed || !same ? 0.0F : 1.0F / (1.0F + std::exp(-then[q]));
          if (is_old) {
            ratio_[c] -= options_.supported * (1 - moved);
            seen_[c] = std::max<std::uint8_t>(seen_[c], 1);
            if (moved < 0.5F) ++support_[c];
          }
          break;
        }
        case DepthEvidence::unknown:
          break;
      }
    }
  }

  /// Surfaces of a view where the present one sees past them.
  void find_gone(const DepthGrid& grid, const SE3<S>& T_c_w, const View& view, Image<float>& gone) const {
    constexpr std::size_t kBlock = 64;
    std::array<int, kBlock> cell;
    std::array<float, kBlock> z;
    if (view.surface.width() != gone.width()) return;
    const SE3<S> T_c_v = T_c_w * view.T_c_w.inverse();
    const auto find = finder(view);
    for (std::size_t first = 0; first < grid.cells(); first += kBlock) {
      const std::size_t n = std::min(kBlock, grid.cells() - first);
      (this->*find)(grid, view.depth, T_c_v, view.shutter, shutter_, first, std::span(cell).first(n),
                    std::span(z).first(n));
      for (std::size_t k = 0; k < n; ++k) {
        if (cell[k] < 0 || view.surface.data()[first + k] == 0) continue;
        const auto q = static_cast<std::size_t>(cell[k]);
        const auto passes = [&](const DepthBounds<float>& b) {
          return free_space_evidence(z[k], b.nearest.data()[q], b.farthest.data()[q], options_.margins) ==
                 DepthEvidence::violation;
        };
        if (passes(bounds_) && (shift_ <= 1 || passes(anywhere_))) gone.data()[q] = z[k];
      }
    }
  }

  /// By how much one surface may be farther than the nearest in a cell.
  [[nodiscard]] float rim(float z) const {
    return options_.margins.violation_base + options_.margins.violation_quad * z * z;
  }

  /// Whether the space at depth z was free, wherever the view was within its doubt.
  [[nodiscard]] bool passes(const View& view, std::size_t q, float z) const {
    return !view.shifted ||
           free_space_evidence(z, view.anywhere.nearest.data()[q], view.anywhere.farthest.data()[q],
                               options_.margins) == DepthEvidence::violation;
  }

  /// find_cells() of the present frame and a view.
  [[nodiscard]] auto finder(const View& view) const {
    return shutter_.moves || view.shutter.moves ? &FreeSpaceHistory::find_cells<true>
                                                : &FreeSpaceHistory::find_cells<false>;
  }

  /// Where a view had the surfaces of the cells first, first + 1, ...: cell (-1: outside) and depth [m].
  /// @tparam kRolling  whether rows were read one after the other; to first order, a hundredth of a cell
  template <bool kRolling>
  void find_cells(const DepthGrid& grid, const Image<float>& depths, const SE3<S>& T_v_c,
                  const GridShutter& from, const GridShutter& then, std::size_t first, std::span<int> cell,
                  std::span<float> z) const {
    const Eigen::Matrix3f R = T_v_c.rotation_matrix().template cast<float>();
    const Eigen::Vector3f t = T_v_c.translation().template cast<float>();
    const float fx = grid.fx(), fy = grid.fy(), cx = grid.cx(), cy = grid.cy();
    const float max_depth = options_.max_depth, near = options_.min_depth;
    const int columns = grid.width();
    const auto width = static_cast<float>(columns), height = static_cast<float>(grid.height());
    const float *depth = depths.data() + first, *rx = grid.ray_x() + first, *ry = grid.ray_y() + first;
    for (std::size_t k = 0; k < cell.size(); ++k) {  // without branches: several at once
      const float d = depth[k];
      float pz, x, y;
      if constexpr (kRolling) {
        // The cell's row is where its ray meets the grid.
        const float now = from.per_row * (from.middle - (fy * ry[k] + cy));
        const Vector p = moved({d * rx[k], d * ry[k], d}, from, now);
        Vector q{R(0, 0) * p.x + R(0, 1) * p.y + R(0, 2) * p.z + t.x(),
                 R(1, 0) * p.x + R(1, 1) * p.y + R(1, 2) * p.z + t.y(),
                 R(2, 0) * p.x + R(2, 1) * p.y + R(2, 2) * p.z + t.z()};
        q = moved(q, then, then.per_row * (fy * q.y / q.z + cy - then.middle));
        pz = q.z;
        x = fx * q.x / q.z + cx;
        y = fy * q.y / q.z + cy;
      } else {
        pz = d * (R(2, 0) * rx[k] + R(2, 1) * ry[k] + R(2, 2)) + t.z();
        const float inverse = 1.0F / pz;
        x = fx * (d * (R(0, 0) * rx[k] + R(0, 1) * ry[k] + R(0, 2)) + t.x()) * inverse + cx;
        y = fy * (d * (R(1, 0) * rx[k] + R(1, 1) * ry[k] + R(1, 2)) + t.y()) * inverse + cy;
      }
      const bool inside = (d > 0.0F) & (d < max_depth) & (pz >= near) & (x >= 0.0F) & (y >= 0.0F) &
                          (x < width) & (y < height);
      // What is outside, or not a number, is not a place that an integer could hold.
      const int i = static_cast<int>(inside ? x : 0.0F), j = static_cast<int>(inside ? y : 0.0F);
      cell[k] = inside ? j * columns + i : -1;
      z[k] = pz;
    }
  }

  struct Vector {
    float x, y, z;
  };
  [[nodiscard]] static Vector moved(const Vector& p, const GridShutter& by, float share) {
    const auto &u = by.upsilon, &w = by.omega;
    return {p.x + share * (w.y() * p.z - w.z() * p.y + u.x()),
            p.y + share * (w.z() * p.x - w.x() * p.z + u.y()),
            p.z + share * (w.x() * p.y - w.y() * p.x + u.z())};
  }

  FreeSpaceOptions options_;
  GridShutter shutter_;             // of the frame last checked
  double now_ = 0;                  // and its time [s]
  std::deque<View> views_;          // newest first
  std::vector<View> spare_;         // memory of dropped views
  Moment last_;                     // frame last remembered, also where it was left out of the views
  std::vector<float> ratio_;        // log-likelihood of motion to that of rest, by cell
  std::vector<std::uint8_t> seen_;  // 1: in some view, 2: with its belief
  std::vector<std::uint8_t> violations_, support_;
  int shift_ = 0;  // of the frame last checked
  Image<std::uint8_t> surface_;
  DepthBounds<float> beside_, bounds_, anywhere_;  // the last two: of the frame last checked
  bool checked_ = false;                           // and not yet remembered
};

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
