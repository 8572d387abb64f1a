// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <limits>
#include <optional>
#include <type_traits>

#include "dynslam/geometry/minimal_models.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/geometry/so3.hpp"

// Of double alone, and templates all the same: who includes them and does not call them waits for no
// compiler.

namespace dynslam {

namespace detail {

/// Distances d of three points along their rays: d_i^2 + d_j^2 - 2 b_ij d_i d_j = a_ij (Grunert 1841).
template <std::same_as<double> W>
class RayDistances {
 public:
  using Matrix3 = Eigen::Matrix<W, 3, 3>;
  using Vector3 = Eigen::Matrix<W, 3, 1>;
  /// @param rays, points  one per column, the rays of norm 1
  RayDistances(const Matrix3& rays, const Matrix3& points) {
    for (int k = 0; k < 3; ++k) {
      const int i = kFirst[k], j = kSecond[k];
      a_[k] = (points.col(i) - points.col(j)).squaredNorm();
      b_[k] = rays.col(i).dot(rays.col(j));
    }
  }

  /// What is found, in `solutions`. @return how many
  [[nodiscard]] int solve(std::array<Vector3, 4>& solutions) const {
    if (!(a_.minCoeff() > W(0))) return 0;
    // Two forms that vanish at d whatever its scale, and the pairs of planes among their combinations.
    const Matrix3 G = homogeneous(0), H = homogeneous(1);
    std::array<Matrix3, 3> pairs;
    const int n = singular_of_pencil<W>(G, H, pairs);
    Eigen::SelfAdjointEigenSolver<Matrix3> eigen;
    Vector3 plus = Vector3::Zero(), minus = Vector3::Zero();
    W clearest = W(0);
    for (int k = 0; k < n; ++k) {
      eigen.compute(pairs[static_cast<std::size_t>(k)]);
      const W clear = std::min(-eigen.eigenvalues()[0], eigen.eigenvalues()[2]);
      if (!(clear > clearest)) continue;  // of one sign: no real planes
      clearest = clear;
      plus = std::sqrt(eigen.eigenvalues()[2]) * eigen.eigenvectors().col(2);
      minus = std::sqrt(-eigen.eigenvalues()[0]) * eigen.eigenvectors().col(0);
    }
    if (!(clearest > W(0))) return 0;
    int found = 0;
    for (const Vector3& normal : {Vector3(plus + minus), Vector3(plus - minus)})
      add_on_plane(normal, G, H, solutions, found);
    return found;
  }

 private:
  static constexpr int kFirst[3] = {0, 0, 1}, kSecond[3] = {1, 2, 2};
  /// Of pair k: d_i^2 + d_j^2 - 2 b d_i d_j.
  [[nodiscard]] W squared(int k, const Vector3& d) const {
    const W x = d[kFirst[k]], y = d[kSecond[k]];
    return x * x + y * y - 2 * b_[k] * x * y;
  }
  /// a_12 times the form of pair k less a_k times that of pair 1-2, of norm 1.
  [[nodiscard]] Matrix3 homogeneous(int k) const {
    Matrix3 m = Matrix3::Zero();
    const auto add = [&](int pair, W scale) {
      const int i = kFirst[pair], j = kSecond[pair];
      m(i, i) += scale;
      m(j, j) += scale;
      m(i, j) -= scale * b_[pair];
      m(j, i) -= scale * b_[pair];
    };
    add(k, a_[2]);
    add(2, -a_[k]);
    return m / m.norm();
  }
  void add_on_plane(const Vector3& normal, const Matrix3& G, const Matrix3& H,
                    std::array<Vector3, 4>& solutions, int& found) const {
    int least = 0;
    normal.cwiseAbs().minCoeff(&least);
    const Vector3 u = normal.cross(Vector3::Unit(least)).normalized(), v = normal.cross(u).normalized();
    const auto within = [&](const Matrix3& m) { return Vector3(u.dot(m * u), u.dot(m * v), v.dot(m * v)); };
    const Vector3 of_G = within(G), of_H = within(H);
    const Vector3& q = of_G.squaredNorm() > of_H.squaredNorm() ? of_G : of_H;
    // q0 x^2 + 2 q1 x y + q2 y^2 = 0; a double root that rounding made complex is one all the same.
    const W discriminant = q[1] * q[1] - q[0] * q[2];
    if (discriminant < W(-1e-10) * q.squaredNorm()) return;
    const W root = std::sqrt(std::max(W(0), discriminant)), far = q[1] < 0 ? root - q[1] : -root - q[1];
    for (const Vector3& d : {Vector3(far * u + q[0] * v), Vector3(q[2] * u + far * v)}) {
      const W sum = d.sum();
      if (!(d.minCoeff() > W(0)) && !(d.maxCoeff() < W(0))) continue;
      const Vector3 positive = sum < 0 ? Vector3(-d) : d;
      const W size = squared(0, positive) + squared(1, positive) + squared(2, positive);
      if (!(size > W(0))) continue;
      const Vector3 scaled = std::sqrt(a_.sum() / size) * positive;
      if (const auto refined = refine(scaled)) solutions[static_cast<std::size_t>(found++)] = *refined;
    }
  }
  /// Newton's steps. @return nullopt where they lead to no solution
  [[nodiscard]] std::optional<Vector3> refine(Vector3 d) const {
    constexpr int kSteps = 5;
    const W enough = W(1e-13) * a_.maxCoeff();
    for (int step = 0; step < kSteps; ++step) {
      const Vector3 error(squared(0, d) - a_[0], squared(1, d) - a_[1], squared(2, d) - a_[2]);
      if (error.cwiseAbs().maxCoeff() < enough) break;
      Matrix3 J = Matrix3::Zero();
      for (int k = 0; k < 3; ++k) {
        const int i = kFirst[k], j = kSecond[k];
        J(k, i) = 2 * (d[i] - b_[k] * d[j]);
        J(k, j) = 2 * (d[j] - b_[k] * d[i]);
      }
      const Matrix3 adjugate = cofactors(J).transpose();
      const W determinant = J.row(0).dot(adjugate.col(0));
      if (!(std::abs(determinant) > std::numeric_limits<W>::min())) break;  // a double solution
      d -= product<W>(adjugate, error) / determinant;
    }
    const Vector3 error(squared(0, d) - a_[0], squared(1, d) - a_[1], squared(2, d) - a_[2]);
    if (!(error.cwiseAbs().maxCoeff() < W(1e-6) * a_.maxCoeff()) || !(d.minCoeff() > W(0)))
      return std::nullopt;
    return d;
  }
  Vector3 a_, b_;
};

/// Axes along a triangle's first side and normal; nullopt where it is a line.
template <std::same_as<double> W>
[[nodiscard]] std::optional<Eigen::Matrix<W, 3, 3>> triangle_axes(const Eigen::Matrix<W, 3, 3>& points) {
  using Vector3 = Eigen::Matrix<W, 3, 1>;
  const Vector3 first = points.col(1) - points.col(0), second = points.col(2) - points.col(0);
  const Vector3 normal = first.cross(second);
  const W size = normal.norm();
  if (!(size > W(1e-9) * first.norm() * second.norm())) return std::nullopt;
  Eigen::Matrix<W, 3, 3> axes;
  axes.col(0) = first.normalized();
  axes.col(2) = normal / size;
  axes.col(1) = axes.col(2).cross(axes.col(0));
  return axes;
}

}  // namespace detail

/// The poses T_c_w from which three points are seen along three rays: distances along the rays by the pairs
/// of planes in the pencil of two quadratic forms (as Persson and Nordberg 2018 do), then the rotation that
/// takes one triangle to the other.
/// @param rays    unit vectors in the camera's frame, one per column
/// @param points  in the world's frame, one per column
/// @param T_c_w   out
/// @return how many: 0 to 4; 0 where the points lie on a line
template <std::same_as<double> W = double>
[[nodiscard]] int perspective_three_point(const std::type_identity_t<Eigen::Matrix<W, 3, 3>>& rays,
                                          const std::type_identity_t<Eigen::Matrix<W, 3, 3>>& points,
                                          std::array<std::type_identity_t<SE3<W>>, 4>& T_c_w) {
  using Matrix3 = Eigen::Matrix<W, 3, 3>;
  using Vector3 = Eigen::Matrix<W, 3, 1>;
  const auto axes_w = detail::triangle_axes<W>(points);
  if (!axes_w) return 0;
  std::array<Vector3, 4> distances;
  const int n = detail::RayDistances<W>(rays, points).solve(distances);
  int found = 0;
  for (int k = 0; k < n; ++k) {
    const Matrix3 seen = rays * distances[static_cast<std::size_t>(k)].asDiagonal();
    const auto axes_c = detail::triangle_axes<W>(seen);
    if (!axes_c) continue;
    const Matrix3 R = detail::product<W>(*axes_c, Matrix3(axes_w->transpose()));
    const Vector3 middle_c = seen.rowwise().mean(), middle_w = points.rowwise().mean();
    T_c_w[static_cast<std::size_t>(found++)] = SE3<W>(SO3<W>(R), Vector3(middle_c - R * middle_w));
  }
  return found;
}

}  // namespace dynslam

#include "dynslam/pop_macros.hpp"
