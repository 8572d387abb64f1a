// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <bit>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <type_traits>
#include <vector>

#include "dynslam/concepts/image.hpp"
#include "dynslam/config.hpp"
#include "dynslam/detail/wide_vectors.hpp"
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
/// Matches that are worked on together: their numbers stay in the first cache. Loops over them are of
/// vectors; only reading pixels goes one by one.
template <std::floating_point S, int N>
struct ResidualBlock {
  using Row = Eigen::Array<S, N, 1>;
  using Indices = Eigen::Array<int, N, 1>;

  /// Squares of four pixels.
  struct Cells {
    Indices column, row;  ///< of the upper left pixel
    Row a, b;             ///< offset from it
    Row has;              ///< 1 inside the image, else 0
  };
  /// Those around (u, v); at the border and outside any.
  template <class I, class U>
  DYNSLAM_ALWAYS_INLINE static void find_cells(const I& image, const U& u, const U& v, Cells& cells) {
    const S w = S(image.width() - 1), h = S(image.height() - 1);
    // A loop for each step: in one, the compiler takes branches for the bounds and no vectors.
    Row x, y;
    for (int i = 0; i < N; ++i) {
      const S x0 = u(i) > S(0) ? u(i) : S(0), y0 = v(i) > S(0) ? v(i) : S(0);  // NaN becomes 0
      x(i) = x0 < w ? x0 : w;
      y(i) = y0 < h ? y0 : h;
    }
    for (int i = 0; i < N; ++i) {
      const S x0 = x(i) < w - S(1) ? x(i) : w - S(1), y0 = y(i) < h - S(1) ? y(i) : h - S(1);
      cells.column(i) = static_cast<int>(x0);
      cells.row(i) = static_cast<int>(y0);
    }
    for (int i = 0; i < N; ++i) {
      cells.a(i) = x(i) - static_cast<S>(cells.column(i));
      cells.b(i) = y(i) - static_cast<S>(cells.row(i));
      const S in_x = x(i) == u(i) ? S(1) : S(0);
      cells.has(i) = y(i) == v(i) ? in_x : S(0);
    }
  }

  /// Bilinear values of an image in cells.
  template <class I>
  DYNSLAM_ALWAYS_INLINE static void sample(const I& image, const Cells& cells, Row& value) {
    using Pixel = typename I::Pixel;
    if constexpr (std::unsigned_integral<Pixel> && sizeof(Pixel) == 1 &&
                  std::endian::native == std::endian::little) {
      Eigen::Array<std::uint32_t, N, 1> four;  // bytes: both of the upper row, both of the lower one
      for (int i = 0; i < N; ++i) {
        std::uint16_t upper, lower;
        std::memcpy(&upper, image.row(cells.row(i)) + cells.column(i), 2);
        std::memcpy(&lower, image.row(cells.row(i) + 1) + cells.column(i), 2);
        four(i) = upper | static_cast<std::uint32_t>(lower) << 16;
      }
      for (int i = 0; i < N; ++i) {
        const auto byte = [&](int shift) { return static_cast<int>(four(i) >> shift & 0xffU); };
        const int p00 = byte(0), p01 = byte(16);
        value(i) = between(cells, i, p00, byte(8) - p00, p01, byte(24) - p01);
      }
    } else {
      // Small integers are gathered as such, which are turned into S several at once.
      using Raw = std::conditional_t<std::integral<Pixel> && sizeof(Pixel) <= 2, int, S>;
      Eigen::Array<Raw, N, 1> p00, p10, p01, p11;
      for (int i = 0; i < N; ++i) {
        const auto* upper = image.row(cells.row(i)) + cells.column(i);
        const auto* lower = image.row(cells.row(i) + 1) + cells.column(i);
        p00(i) = static_cast<Raw>(upper[0]);
        p10(i) = static_cast<Raw>(upper[1]);
        p01(i) = static_cast<Raw>(lower[0]);
        p11(i) = static_cast<Raw>(lower[1]);
      }
      for (int i = 0; i < N; ++i)
        value(i) = between(cells, i, p00(i), p10(i) - p00(i), p01(i), p11(i) - p01(i));
    }
  }
  template <class Raw>
  DYNSLAM_ALWAYS_INLINE static S between(const Cells& cells, int i, Raw upper_left, Raw upper_step,
                                         Raw lower_left, Raw lower_step) {
    const S upper = static_cast<S>(upper_left) + cells.a(i) * static_cast<S>(upper_step);
    const S lower = static_cast<S>(lower_left) + cells.a(i) * static_cast<S>(lower_step);
    return upper + cells.b(i) * (lower - upper);
  }

  /// Depth at the nearest pixel; `has` is 0 outside and where it is invalid.
  template <class D, class U>
  DYNSLAM_ALWAYS_INLINE static void look_up(const D& depth, const U& u, const U& v, Row& value, Row& has) {
    // Places in pixels' areas, which begin at 0; truncated they are the nearest pixel.
    const S low = std::numeric_limits<S>::min();
    const S w = std::nextafter(S(depth.width()), S(0)), h = std::nextafter(S(depth.height()), S(0));
    Indices column, row;
    for (int i = 0; i < N; ++i) {
      const S x = u(i) + S(0.5), y = v(i) + S(0.5);
      const S x0 = x > low ? x : low, y0 = y > low ? y : low;
      const S x1 = x0 < w ? x0 : w, y1 = y0 < h ? y0 : h;
      column(i) = static_cast<int>(x1);
      row(i) = static_cast<int>(y1);
      const S in_x = x1 == x ? S(1) : S(0);
      has(i) = y1 == y ? in_x : S(0);
    }
    for (int i = 0; i < N; ++i) value(i) = static_cast<S>(depth.row(row(i))[column(i)]);
    for (int i = 0; i < N; ++i) {
      const S z = value(i), positive = z > S(0) ? has(i) : S(0);
      has(i) = z <= std::numeric_limits<S>::max() ? positive : S(0);
    }
  }
};

template <std::floating_point S, int N, class A, class B, class D>
DYNSLAM_ALWAYS_INLINE inline void residual_block(const Pinhole<S>& camera, const MatchRows<S>& m,
                                                 std::size_t begin, const A& reference_gray, const B& gray,
                                                 const D& depth, const Eigen::Matrix<S, 3, 4>& T,
                                                 const StaticWeightScales<S>& scales,
                                                 const DepthNoise<S>& noise, S nu, ResidualRows<S>& out) {
  using Block = ResidualBlock<S, N>;
  using Row = typename Block::Row;
  const auto in = [begin](const std::vector<S>& row) { return Eigen::Map<const Row>(row.data() + begin); };
  const auto to = [begin](std::vector<S>& row) { return Eigen::Map<Row>(row.data() + begin); };
  const auto p_x = in(m.p_x), p_y = in(m.p_y), p_z = in(m.p_z), x_m = in(m.x_m), y_m = in(m.y_m);
  // What is calculated before it is chosen stays without branches. Quotients and roots are far from each
  // other and beside what reads pixels, since a processor has one unit for them all.
  Row z, u, v, square;  // of the reprojection error
  for (int i = 0; i < N; ++i) {
    const S x = T(0, 0) * p_x(i) + T(0, 1) * p_y(i) + T(0, 2) * p_z(i) + T(0, 3);
    const S y = T(1, 0) * p_x(i) + T(1, 1) * p_y(i) + T(1, 2) * p_z(i) + T(1, 3);
    z(i) = T(2, 0) * p_x(i) + T(2, 1) * p_y(i) + T(2, 2) * p_z(i) + T(2, 3);
    const S inverse = S(1) / z(i);
    u(i) = camera.fx() * (x * inverse) + camera.cx();
    v(i) = camera.fy() * (y * inverse) + camera.cy();
    const S du = u(i) - x_m(i), dv = v(i) - y_m(i);
    square(i) = du * du + dv * dv;
  }
  Row front, behind;
  for (int i = 0; i < N; ++i) {
    front(i) = z(i) > S(1e-6) ? S(1) : S(0);
    behind(i) = z(i) > S(1e-6) ? S(0) : std::numeric_limits<S>::infinity();
    square(i) = z(i) > S(1e-6) ? square(i) : S(0);
  }
  Row d, has_d, e_d, sum;  // of the weight's denominator
  Block::look_up(depth, x_m, y_m, d, has_d);
  for (int i = 0; i < N; ++i) {
    has_d(i) *= front(i);
    e_d(i) = z(i) - d(i);
  }
  for (int i = 0; i < N; ++i) e_d(i) = has_d(i) > S(0) ? e_d(i) : S(0);
  const S per_pixel = S(1) / (scales.reprojection * scales.reprojection),
          per_grey = S(1) / scales.photometric;
  const S sigmas = scales.depth, base = noise.base, linear = noise.linear, quad = noise.quad;
  for (int i = 0; i < N; ++i) {
    const S in_sigmas = e_d(i) / (sigmas * (base + z(i) * (linear + quad * z(i))));
    sum(i) = nu + (square(i) * per_pixel + in_sigmas * in_sigmas);
  }
  typename Block::Cells cells_ref, cells;
  Row i_ref, i_cur;
  Block::find_cells(reference_gray, in(m.x), in(m.y), cells_ref);
  Row root;
  square_roots<N>(square.data(), root.data());
  to(out.reprojection) = root + behind;
  Block::sample(reference_gray, cells_ref, i_ref);
  Block::find_cells(gray, u, v, cells);
  Block::sample(gray, cells, i_cur);
  Row has_i, e_i, weight, dimension;
  for (int i = 0; i < N; ++i) {
    has_i(i) = cells_ref.has(i) * cells.has(i) * front(i);
    e_i(i) = i_ref(i) - i_cur(i);
  }
  for (int i = 0; i < N; ++i) e_i(i) = has_i(i) > S(0) ? e_i(i) : S(0);
  for (int i = 0; i < N; ++i) {
    const S scaled = e_i(i) * per_grey;
    dimension(i) = S(1) + has_i(i) + has_d(i);
    weight(i) = front(i) * (nu + dimension(i)) / (sum(i) + scaled * scaled);
  }
  to(out.photometric) = e_i;
  to(out.depth) = e_d;
  to(out.weight) = weight;
  to(out.dimension) = dimension;
}

template <std::floating_point S, class A, class B, class D>
DYNSLAM_ALWAYS_INLINE inline void residual_blocks(const Pinhole<S>& camera, const MatchRows<S>& m,
                                                  const A& reference_gray, const B& gray, const D& depth,
                                                  const Eigen::Matrix<S, 3, 4>& T,
                                                  const StaticWeightScales<S>& scales,
                                                  const DepthNoise<S>& noise, S nu, ResidualRows<S>& out) {
  constexpr int kBlock = 40;
  const std::size_t n = m.size();
  std::size_t k = 0;
  for (; k < n && n >= kBlock; k += kBlock)  // the last block may overlap the one before
    residual_block<S, kBlock>(camera, m, std::min(k, n - kBlock), reference_gray, gray, depth, T, scales,
                              noise, nu, out);
  for (; k < n; ++k)
    residual_block<S, 1>(camera, m, k, reference_gray, gray, depth, T, scales, noise, nu, out);
}
}  // namespace detail

/// Eqs (3), (5), (6) and (7) of all matches at once: photometric, reprojection and depth error and the joint
/// weight. The same as photometric_residual, reprojection_residual, depth_residual and static_weight one by
/// one, up to rounding, three to five times as fast; as cameras with a lens differ, for ideal pixels of a
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
  out.resize(matches.size());
  Eigen::Matrix<S, 3, 4> T;
  T << T_cur_ref.rotation_matrix(), T_cur_ref.translation();
  detail::with_wide_vectors([](auto&... args) DYNSLAM_ALWAYS_INLINE { detail::residual_blocks(args...); },
                            camera, matches, reference_gray, gray, depth, T, scales, noise, nu, out);
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
