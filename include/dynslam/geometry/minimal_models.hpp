// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <optional>
#include <type_traits>
#include <utility>

#include "dynslam/geometry/detail/epipolar_null_space.hpp"
#include "dynslam/geometry/so3.hpp"

// Of double alone, and templates all the same: who includes them and does not call them waits for no
// compiler.

namespace dynslam {

namespace detail {
/// Real roots of t^3 + b t^2 + c t + d, double ones as often as they count. @return how many: 1 or 3
inline int real_roots(double b, double c, double d, std::array<double, 3>& roots) {
  constexpr double kThird = 1.0 / 3.0, kTiny = 1e-12;
  const double shift = b * kThird, p = (b * b - 3 * c) / 9, q = (b * (2 * b * b - 9 * c) + 27 * d) / 54;
  const double p3 = p * p * p;
  int n = 0;
  // Rounding must not take a double root for a pair of complex ones: rectified views have them.
  if (q * q - p3 < kTiny * p3) {  // three
    const double size = -2 * std::sqrt(p),
                 angle = std::acos(std::clamp(q / std::sqrt(p3), -1.0, 1.0)) * kThird;
    constexpr double kStep = 2.0943951023931953;  // a third of a turn
    for (const double offset : {0.0, kStep, -kStep})
      roots[static_cast<std::size_t>(n++)] = size * std::cos(angle + offset) - shift;
  } else {
    const double e = -std::copysign(std::cbrt(std::abs(q) + std::sqrt(q * q - p3)), q);
    roots[static_cast<std::size_t>(n++)] = e + (e != 0 ? p / e : 0.0) - shift;
  }
  for (int k = 0; k < n; ++k) {  // a step of Newton's: the closed form loses digits near double roots
    double& t = roots[static_cast<std::size_t>(k)];
    const double slope = c + t * (2 * b + 3 * t);
    if (std::abs(slope) > kTiny) t -= (d + t * (c + t * (b + t))) / slope;
  }
  return n;
}

/// The matrices of rank 2 in the pencil of G and H, in `F`: roots of the cubic form det(t G + s H), the one
/// at infinity (G itself) among them. @return how many; 0 where every matrix of the pencil is singular
template <std::same_as<double> W>
[[nodiscard]] int singular_of_pencil(Eigen::Matrix<W, 3, 3> G, Eigen::Matrix<W, 3, 3> H,
                                     std::array<Eigen::Matrix<W, 3, 3>, 3>& F) {
  using Matrix3 = Eigen::Matrix<W, 3, 3>;
  const Matrix3 cG = cofactors(G), cH = cofactors(H);
  double a = G.col(0).dot(cG.col(0)), b = cG.cwiseProduct(H).sum(), c = cH.cwiseProduct(G).sum(),
         d = H.col(0).dot(cH.col(0));
  // A cubic form vanishes in three directions at most. Of G, H, G + H and G - H, the one in which it is
  // largest becomes G, so that no root is at infinity or near it.
  const double plus = a + b + c + d, minus = a - b + c - d;
  if (std::max(std::abs(plus), std::abs(minus)) > std::max(std::abs(a), std::abs(d))) {
    const Matrix3 sum = G + H;
    H = G - H;
    G = sum;
    const double b_new = 3 * (a - d) + b - c, c_new = 3 * (a + d) - b - c;
    a = plus, b = b_new, c = c_new, d = minus;
  }
  if (std::abs(d) > std::abs(a)) {
    std::swap(a, d);
    std::swap(b, c);
    std::swap(G, H);
  }
  // The pencil's matrices have unit norm, the cubic a size of 1: less than this is rounding.
  if (!(std::abs(a) > 1e-14)) return 0;
  std::array<double, 3> t{};
  const int n = real_roots(b / a, c / a, d / a, t);
  for (int k = 0; k < n; ++k) {
    Matrix3& m = F[static_cast<std::size_t>(k)];
    for (int i = 0; i < 9; ++i) m.data()[i] = t[static_cast<std::size_t>(k)] * G.data()[i] + H.data()[i];
    m /= m.norm();
  }
  return n;
}
}  // namespace detail

/// The one to three F of rank 2 with q^T F p = 0 for seven matches (Hartley and Zisserman, 11.1.2), in the
/// matches' coordinates, which should be near 1 in size.
/// @param p, q  homogeneous points of the two images, one per column
/// @param F     out
/// @return how many; 0 where the matches leave more than one pencil of F
template <std::same_as<double> W = double>
[[nodiscard]] int fundamental_seven_point(const std::type_identity_t<Eigen::Matrix<W, 3, 7>>& p,
                                          const std::type_identity_t<Eigen::Matrix<W, 3, 7>>& q,
                                          std::array<std::type_identity_t<Eigen::Matrix<W, 3, 3>>, 3>& F) {
  using Matrix3 = Eigen::Matrix<W, 3, 3>;
  std::array<Matrix3, 2> pencil;
  if (!detail::epipolar_null_space<7>(p, q, pencil)) return 0;
  Matrix3 &G = pencil[0], &H = pencil[1];
  G /= G.norm();
  H /= H.norm();
  return detail::singular_of_pencil<W>(G, H, F);
}

/// The H with q ~ H p for four matches, by way of the projective basis that each image's four points are.
/// @param p, q  homogeneous points of the two images, one per column
/// @return nullopt where three of the points are on a line, and where no camera sees the four in this order
///         from one side of a plane
template <std::same_as<double> W = double>
[[nodiscard]] std::optional<Eigen::Matrix<W, 3, 3>> homography_four_point(
    const std::type_identity_t<Eigen::Matrix<W, 3, 4>>& p,
    const std::type_identity_t<Eigen::Matrix<W, 3, 4>>& q) {
  using Matrix3 = Eigen::Matrix<W, 3, 3>;
  using Vector3 = Eigen::Matrix<W, 3, 1>;
  Matrix3 basis[2], inverse[2];
  Vector3 weight[2];
  for (int side = 0; side < 2; ++side) {
    const auto& points = side == 0 ? p : q;
    Matrix3& m = basis[side];
    for (int i = 0; i < 9; ++i) m.data()[i] = points.data()[i];
    const Matrix3 adjugate = detail::cofactors(m).transpose();
    const double determinant =
        adjugate(0, 0) * m(0, 0) + (adjugate(0, 1) * m(1, 0) + adjugate(0, 2) * m(2, 0));
    if (!(std::abs(determinant) > 1e-6)) return std::nullopt;
    weight[side] = detail::product<W>(adjugate, Vector3(points(0, 3), points(1, 3), points(2, 3)));
    for (int i = 0; i < 3; ++i) {
      weight[side][i] /= determinant;
      if (!(std::abs(weight[side][i]) > 1e-6)) return std::nullopt;
    }
    for (int i = 0; i < 9; ++i) inverse[side].data()[i] = adjugate.data()[i] / determinant;
  }
  for (int c = 0; c < 3; ++c) {
    const double ratio = weight[1][c] / weight[0][c];
    if (!(ratio > 0)) return std::nullopt;
    for (int r = 0; r < 3; ++r) basis[1](r, c) *= ratio;
  }
  Matrix3 H = detail::product<W>(basis[1], inverse[0]);
  H /= H.norm();
  return H;
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
