// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <limits>
#include <type_traits>
#include <vector>

#include "dynslam/concepts/image.hpp"
#include "dynslam/config.hpp"
#include "dynslam/dynamics/static_weight.hpp"
#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/robust/t_distribution.hpp"

namespace dynslam {

/// Keypoints of a reference image and their matches, a row of numbers for each quantity, so that several are
/// worked on at once. Pixels are ideal ones.
template <std::floating_point S>
struct MatchRows {
  std::vector<S> x, y;           ///< in the reference image [px]
  std::vector<S> p_x, p_y, p_z;  ///< in the reference camera's frame [m]
  std::vector<S> x_m, y_m;       ///< where it was found in the present image [px]

  [[nodiscard]] std::size_t size() const { return x.size(); }
  void clear() {
    for (auto* row : {&x, &y, &p_x, &p_y, &p_z, &x_m, &y_m}) row->clear();
  }
  void push_back(const Eigen::Matrix<S, 2, 1>& pixel, const Eigen::Matrix<S, 3, 1>& p,
                 const Eigen::Matrix<S, 2, 1>& match) {
    x.push_back(pixel.x());
    y.push_back(pixel.y());
    p_x.push_back(p.x());
    p_y.push_back(p.y());
    p_z.push_back(p.z());
    x_m.push_back(match.x());
    y_m.push_back(match.y());
  }
};

/// Errors and joint weight of each match. An error that is missing is 0 and not counted in `dimension`.
template <std::floating_point S>
struct ResidualRows {
  std::vector<S> photometric;   ///< Eq (3) [grey values]
  std::vector<S> reprojection;  ///< Eq (5) [px]; infinite where the point is not in front of the camera
  std::vector<S> depth;         ///< Eq (6) [m]
  std::vector<S> weight;        ///< Eq (7) with the numerator nu + d
  std::vector<S> dimension;     ///< d: how many errors there are, 1 to 3
  void resize(std::size_t n) {
    for (auto* row : {&photometric, &reprojection, &depth, &weight, &dimension}) row->resize(n);
  }
};

namespace detail {
/// Matches that are worked on together: their numbers stay in the first cache.
template <std::floating_point S, int N>
struct ResidualBlock {
  using Row = Eigen::Array<S, N, 1>;

  /// Bilinear values of an image of bytes; 0 and a `has` of 0 outside. The cells are found and weighed for
  /// all together; only reading the pixels goes one by one.
  template <class I>
  static void sample(const I& image, const Row& u, const Row& v, Row& value, Row& has) {
    const S w = S(image.width() - 2), h = S(image.height() - 2);
    std::array<int, std::size_t(N)> column, row;
    // Bytes are gathered as integers, which are turned into S several at once.
    using Raw =
        std::conditional_t<std::integral<typename I::Pixel> && sizeof(typename I::Pixel) <= 2, int, S>;
    std::array<Raw, std::size_t(N)> p00, p10, p01, p11;
    Row a, b;
    for (int i = 0; i < N; ++i) {
      const S x = u(i) > S(0) ? u(i) : S(0), y = v(i) > S(0) ? v(i) : S(0);  // NaN becomes 0
      const S x1 = x < w ? x : w, y1 = y < h ? y : h;
      column[std::size_t(i)] = static_cast<int>(x1);
      row[std::size_t(i)] = static_cast<int>(y1);
    }
    for (int i = 0; i < N; ++i) {
      a(i) = u(i) - static_cast<S>(column[std::size_t(i)]);
      b(i) = v(i) - static_cast<S>(row[std::size_t(i)]);
    }
    for (int i = 0; i < N; ++i) {
      const auto* top = image.row(row[std::size_t(i)]) + column[std::size_t(i)];
      const auto* bottom = image.row(row[std::size_t(i)] + 1) + column[std::size_t(i)];
      p00[std::size_t(i)] = static_cast<Raw>(top[0]);
      p10[std::size_t(i)] = static_cast<Raw>(top[1]);
      p01[std::size_t(i)] = static_cast<Raw>(bottom[0]);
      p11[std::size_t(i)] = static_cast<Raw>(bottom[1]);
    }
    for (std::size_t i = 0; i < std::size_t(N); ++i) {
      const auto k = static_cast<Eigen::Index>(i);
      const S upper = static_cast<S>(p00[i]) + a(k) * static_cast<S>(p10[i] - p00[i]);
      const S lower = static_cast<S>(p01[i]) + a(k) * static_cast<S>(p11[i] - p01[i]);
      value(k) = upper + b(k) * (lower - upper);
    }
    for (int i = 0; i < N; ++i) {  // a and b are in [0, 1] inside
      const S in_a = a(i) >= S(0) ? S(1) : S(0), in_b = b(i) >= S(0) ? S(1) : S(0);
      const S to_a = a(i) <= S(1) ? in_a : S(0), to_b = b(i) <= S(1) ? in_b : S(0);
      has(i) = to_a * to_b;
    }
  }

  /// Depth at the nearest pixel; `has` is 0 outside and where it is invalid.
  template <class D>
  static void look_up(const D& depth, const Row& u, const Row& v, Row& value, Row& has) {
    const S w = S(depth.width() - 1), h = S(depth.height() - 1);
    std::array<int, std::size_t(N)> column, row;
    Row inside;
    for (int i = 0; i < N; ++i) {
      const S x = u(i) + S(0.5), y = v(i) + S(0.5);  // of the pixel's area; truncated: nearest
      const S x0 = x > S(0) ? x : S(0), y0 = y > S(0) ? y : S(0);
      const S x1 = x0 < w ? x0 : w, y1 = y0 < h ? y0 : h;
      column[std::size_t(i)] = static_cast<int>(x1);
      row[std::size_t(i)] = static_cast<int>(y1);
      const S left = x > S(0) ? S(1) : S(0), top = y > S(0) ? S(1) : S(0);
      const S right = x < w + S(1) ? left : S(0), bottom = y < h + S(1) ? top : S(0);
      inside(i) = right * bottom;
    }
    for (int i = 0; i < N; ++i)
      value(i) = static_cast<S>(depth.row(row[std::size_t(i)])[column[std::size_t(i)]]);
    for (int i = 0; i < N; ++i) {
      const S z = value(i), positive = z > S(0) ? inside(i) : S(0);
      has(i) = z <= std::numeric_limits<S>::max() ? positive : S(0);
      value(i) = has(i) > S(0) ? z : S(0);
    }
  }
};

template <std::floating_point S, int N, class A, class B, class D>
void residual_block(const Pinhole<S>& camera, const MatchRows<S>& m, std::size_t begin,
                    const A& reference_gray, const B& gray, const D& depth, const Eigen::Matrix<S, 3, 4>& T,
                    const StaticWeightScales<S>& scales, const DepthNoise<S>& noise, S nu,
                    ResidualRows<S>& out) {
  using Block = ResidualBlock<S, N>;
  using Row = typename Block::Row;
  const auto in = [begin](const std::vector<S>& row) { return Eigen::Map<const Row>(row.data() + begin); };
  const auto to = [begin](std::vector<S>& row) { return Eigen::Map<Row>(row.data() + begin); };
  const auto p_x = in(m.p_x), p_y = in(m.p_y), p_z = in(m.p_z);
  const Row x = T(0, 0) * p_x + T(0, 1) * p_y + T(0, 2) * p_z + T(0, 3);
  const Row y = T(1, 0) * p_x + T(1, 1) * p_y + T(1, 2) * p_z + T(1, 3);
  const Row z = T(2, 0) * p_x + T(2, 1) * p_y + T(2, 2) * p_z + T(2, 3);
  const Row inverse = S(1) / z;
  const Row u = camera.fx() * (x * inverse) + camera.cx(), v = camera.fy() * (y * inverse) + camera.cy();
  Row i_ref, i_cur, has_ref, has_cur, d, has_d;
  Block::sample(reference_gray, Row(in(m.x)), Row(in(m.y)), i_ref, has_ref);
  Block::sample(gray, u, v, i_cur, has_cur);
  Block::look_up(depth, Row(in(m.x_m)), Row(in(m.y_m)), d, has_d);
  Row front;
  for (int i = 0; i < N; ++i) front(i) = z(i) > S(1e-6) ? S(1) : S(0);
  const Row has_i = has_ref * has_cur * front;
  has_d *= front;
  const Row sigma = noise.base + noise.linear * z + noise.quad * z * z;
  const Row e_c = ((u - in(m.x_m)).square() + (v - in(m.y_m)).square()).sqrt();
  Row e_i = i_ref - i_cur, e_d = z - d;
  for (int i = 0; i < N; ++i) {
    e_i(i) = has_i(i) > S(0) ? e_i(i) : S(0);
    e_d(i) = has_d(i) > S(0) ? e_d(i) : S(0);
  }
  const Row s = (e_c * (S(1) / scales.reprojection)).square() + (e_i * (S(1) / scales.photometric)).square() +
                (e_d / (scales.depth * sigma)).square();
  const Row dimension = S(1) + has_i + has_d, weight = (nu + dimension) / (nu + s);
  to(out.photometric) = e_i;
  to(out.depth) = e_d;
  to(out.dimension) = dimension;
  constexpr S kFar = std::numeric_limits<S>::infinity();
  S *reprojection = out.reprojection.data() + begin, *joint = out.weight.data() + begin;
  for (int i = 0; i < N; ++i) {
    reprojection[i] = front(i) > S(0) ? e_c(i) : kFar;
    joint[i] = front(i) > S(0) ? weight(i) : S(0);
  }
}
}  // namespace detail

/// Eqs (3), (5), (6) and (7) of all matches at once: photometric, reprojection and depth error and the joint
/// weight. The same as photometric_residual, reprojection_residual, depth_residual and static_weight one by
/// one, up to rounding, two to three times as fast; as cameras with a lens differ, for ideal pixels of a
/// pinhole camera. static_weights() takes any camera and any image, one by one: of its time, most of which
/// finds F and H, the batch would save a fiftieth.
/// @param scales  those of the depth in standard deviations of `noise` at the point's depth
/// @param gray, reference_gray, depth  images of 2 x 2 pixels or more with contiguous rows
/// @param out     resized
template <std::floating_point S, RowImage A, RowImage B, RowImage D>
  requires DepthImage<D>
void residual_batch(const Pinhole<S>& camera, const MatchRows<S>& matches, const A& reference_gray,
                    const B& gray, const D& depth, const SE3<S>& T_cur_ref,
                    const StaticWeightScales<S>& scales, const DepthNoise<S>& noise, S nu,
                    ResidualRows<S>& out) {
  DYNSLAM_ASSERT(gray.width() > 1 && gray.height() > 1 && reference_gray.width() > 1 &&
                     reference_gray.height() > 1 && depth.width() > 0 && depth.height() > 0,
                 "an image needs two pixels in each direction");
  const std::size_t n = matches.size();
  out.resize(n);
  Eigen::Matrix<S, 3, 4> T;
  T << T_cur_ref.rotation_matrix(), T_cur_ref.translation();
  constexpr int kBlock = 32;
  std::size_t k = 0;
  for (; k + kBlock <= n; k += kBlock)
    detail::residual_block<S, kBlock>(camera, matches, k, reference_gray, gray, depth, T, scales, noise, nu,
                                      out);
  for (; k < n; ++k)
    detail::residual_block<S, 1>(camera, matches, k, reference_gray, gray, depth, T, scales, noise, nu, out);
}

}  // namespace dynslam
