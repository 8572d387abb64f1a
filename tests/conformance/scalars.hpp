// SPDX-License-Identifier: BSD-3-Clause
// What takes any Scalar, as functions of a small motion: float, double, and numbers that carry derivatives.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstdint>
#include <string>

#include "cameras.hpp"
#include "dynslam/concepts/camera.hpp"
#include "dynslam/concepts/image.hpp"
#include "dynslam/concepts/robust.hpp"
#include "dynslam/concepts/scalar.hpp"
#include "dynslam/dynamics/residuals.hpp"
#include "dynslam/dynamics/static_weight.hpp"
#include "dynslam/geometry/brown_conrady.hpp"
#include "dynslam/geometry/detail/first_root.hpp"
#include "dynslam/geometry/epipolar.hpp"
#include "dynslam/geometry/epipolar_distance.hpp"
#include "dynslam/geometry/homography.hpp"
#include "dynslam/geometry/ideal_pinhole.hpp"
#include "dynslam/geometry/kannala_brandt.hpp"
#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/geometry/pixel_ray.hpp"
#include "dynslam/geometry/rolling_camera.hpp"
#include "dynslam/geometry/rolling_shutter.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/geometry/so3.hpp"
#include "dynslam/image/image.hpp"
#include "dynslam/image/sample.hpp"
#include "dynslam/image/widen.hpp"
#include "dynslam/optim/bundle_adjustment.hpp"
#include "dynslam/optim/normal_equations.hpp"
#include "dynslam/optim/pose_equations.hpp"
#include "dynslam/optim/pose_graph.hpp"
#include "dynslam/optim/pose_residual.hpp"
#include "dynslam/robust/kernels.hpp"
#include "dynslam/robust/t_distribution.hpp"
#include "record.hpp"

namespace dynslam::test {

namespace conformance {

inline Image<float> waves(double phase) {
  Image<float> image(kWidth, kHeight);
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u)
      image(u, v) = static_cast<float>(100 + 60 * std::sin(0.11 * u + phase) * std::cos(0.07 * v - phase));
  }
  return image;
}

template <Scalar S>
SE3<S> reference_pose() {
  Eigen::Matrix<double, 6, 1> xi;
  xi << 0.2, -0.1, 0.15, 0.05, -0.08, 0.06;
  return SE3<double>::exp(xi).cast<S>();
}

template <Scalar S>
void motions(const SE3<S>& T, Record<S>& out) {
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  const Vector3 p(S(0.3), S(-0.2), S(2.5));
  const auto xi = T.log();
  out.put("se3.log", xi);
  out.put("se3.matrix", T.matrix());
  out.put("se3.inverse", T.inverse() * p);
  out.put("se3.isometry", T.isometry() * p);
  out.put("se3.adjoint", T.adjoint());
  out.put("se3.left_jacobian_inverse", SE3<S>::left_jacobian_inverse(xi));
  const SO3<S>& R = T.so3();
  out.put("so3.times", (R * R.inverse() * R) * p);
  out.put("so3.adjoint", R.adjoint());
  out.put("so3.exp", SO3<S>::exp(R.log()).matrix());
  out.put("so3.left_jacobian", SO3<S>::left_jacobian(R.log()));
  out.put("so3.left_jacobian_inverse", SO3<S>::left_jacobian_inverse(R.log()));
  out.put("so3.vee", SO3<S>::vee(SO3<S>::hat(R.log())));
  out.put("so3.from_matrix", SO3<S>(R.matrix()).log());
  out.put("so3.from_quaternion", SE3<S>(R.quaternion(), T.translation()).log());
  // A rotation of nearly nothing takes another branch.
  const SE3<S> tiny = T * reference_pose<S>().inverse();
  out.put("se3.tiny", tiny.log());
  out.put("se3.tiny.left_jacobian_inverse", SE3<S>::left_jacobian_inverse(tiny.log()));
}

template <class Camera>
void projections(const Camera& camera, const SE3<typename Camera::ScalarType>& T,
                 Record<typename Camera::ScalarType>& out) {
  using S = typename Camera::ScalarType;
  using Vector2 = Eigen::Matrix<S, 2, 1>;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  using Matrix23 = Eigen::Matrix<S, 2, 3>;
  const std::string name = ConformanceCamera<Camera>::name;
  PoseEquations<S> sums;
  NormalEquations<S, 6> system, rows;
  for (const double side : {-0.7, -0.2, 0.1, 0.4, 0.8}) {
    PoseObservation<S> o;
    o.p_w = Vector3(S(side), S(0.3 - side * side), S(2.5 + 0.3 * side));
    o.depth = S(2.6);
    o.inv_sigma_px2 = S(0.5);
    o.inv_sigma_z2 = S(100);
    const Vector3 p_c = T * o.p_w;
    Matrix23 J = Matrix23::Zero();
    const auto x = camera.project(p_c, &J);
    REQUIRE(x.has_value());
    o.x = Vector2(S(80), S(60)) + S(0.9) * (*x - Vector2(S(80), S(60)));
    out.put(name + ".project", *camera.project(p_c));
    const RollingShutter<S> shutter(S(0.1) * T.log(), 120);
    out.put(name + ".rolling_shutter", *shutter.project(camera, p_c));
    out.put(name + ".to_middle", shutter.to_middle(shutter.to_row(p_c, S(20)), S(20)));
    const RollingCamera<Camera> rolling(camera, shutter);
    const auto p_middle = rolling.unproject(*x, p_c.z());
    REQUIRE(p_middle.has_value());
    Matrix23 J_row = Matrix23::Zero();
    out.put(name + ".rolling_camera", *rolling.project(*p_middle, &J_row));
    out.put(name + ".rolling_camera.derivative", J_row);
    out.put(name + ".rolling_camera.undistort", *rolling.undistort_pixel(*x, p_c.z()));
    out.put(name + ".rolling_camera.depth", rolling.depth_at_middle(*x, p_c.z()));
    out.put(name + ".derivative", J);
    const auto back = camera.unproject(*x, p_c.z());
    REQUIRE(back.has_value());
    out.put(name + ".unproject", *back);
    const Pinhole<S> pinhole = ideal_pinhole(camera);
    out.put(name + ".ideal_pinhole", pinhole.K());
    const auto ideal = to_ideal(camera, pinhole, *x);
    REQUIRE(ideal.has_value());
    out.put(name + ".to_ideal", *ideal);
    out.put(name + ".from_ideal", *from_ideal(camera, pinhole, *ideal));
    Vector3 r = Vector3::Zero();
    Eigen::Matrix<S, 3, 6> J_pose = Eigen::Matrix<S, 3, 6>::Zero();
    REQUIRE(point_residual(camera, p_c, o, r));
    REQUIRE(point_residual(camera, T * o.p_w, o, r, &J));
    REQUIRE(pose_residual(camera, T, o, r));
    REQUIRE(pose_residual(camera, T, o, r, &J_pose));
    out.put(name + ".pose_residual", r);
    out.put(name + ".pose_residual.derivative", J_pose);
    out.put(name + ".observation_chi2", observation_chi2(camera, T, o));
    out.put(name + ".bundle_chi2",
            bundle_chi2(camera, T, o.p_w, BundleObservation<S>{0, 0, o.x, o.depth, S(0.5), S(100)}));
    PointLinearisation<Camera> point;
    REQUIRE(point.at(camera, p_c, o));
    sums.add(point.terms(camera, o.inv_sigma_px2, o.inv_sigma_z2));
    const Vector3 information(o.inv_sigma_px2, o.inv_sigma_px2, o.inv_sigma_z2);
    for (int i = 0; i < 3; ++i) rows.add_row(J_pose.row(i), r(i), information(i));
  }
  sums.store(system);
  out.put(name + ".hessian", S(1e-3) * system.hessian());
  out.put(name + ".gradient", S(1e-3) * system.gradient());
  out.put(name + ".rows.hessian", S(1e-3) * rows.hessian());
  Eigen::Matrix<S, 6, 1> step = Eigen::Matrix<S, 6, 1>::Zero();
  REQUIRE(rows.solve(S(0.01), step));
  out.put(name + ".step", step);
}

template <Scalar S>
void errors_and_weights(const SE3<S>& T, Record<S>& out) {
  using Vector2 = Eigen::Matrix<S, 2, 1>;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  static const Image<float> reference = waves(0), current = waves(0.3), depth(kWidth, kHeight, 2.53F);
  const auto camera = conformance_camera<PinholeBrownConrady<S>>();
  const Vector3 p_c = T * Vector3(S(0.1), S(0.15), S(2.5));
  const auto projected = camera.project(p_c);
  REQUIRE(projected.has_value());
  const Vector2 x(S(70.4), S(52.3)), x_m(S(88.2), S(63.7));
  const auto sample = bilinear_with_gradient(current, projected->x(), projected->y());
  REQUIRE(sample.has_value());
  out.put("sample.value", sample->value);
  out.put("sample.gradient", sample->gradient);
  out.put("bilinear", *bilinear(current, projected->x(), projected->y()));
  const auto e_i = photometric_residual(reference, x, current, *projected);
  const auto e_d = depth_residual(p_c, depth, x_m);
  REQUIRE(e_i.has_value());
  REQUIRE(e_d.has_value());
  const KeypointResiduals<S> e{e_i, reprojection_residual(*projected, x_m), e_d};
  out.put("photometric", *e_i);
  out.put("reprojection", e.reprojection);
  out.put("depth", *e_d);
  const StaticWeightScales<S> scales{S(6), S(2), S(0.02)};
  const S s = squared_normalised(e, scales);
  out.put("squared_normalised", s);
  out.put("static_weight", static_weight(e, scales, S(5)));
  out.put("static_weight.paper", static_weight(e, scales, TDistribution<S>::paper()));
  const auto kernel = [&](const char* name, const auto& k) {
    static_assert(RobustKernel<std::decay_t<decltype(k)>, S>);
    const S far = s;
    const S near = S(0.3) * s / (S(1) + s);
    for (const S& at : {near, far}) {
      out.put(std::string(name) + ".rho", k.rho(at));
      out.put(std::string(name) + ".weight", k.weight(at));
    }
  };
  kernel("squared", SquaredLoss<S>());
  kernel("huber", Huber<S>());
  kernel("cauchy", Cauchy<S>());
  kernel("tukey", Tukey<S>());
  kernel("t", TDistribution<S>::with_dimension(S(5), 1));
  kernel("t.dimension", TDistribution<S>::with_dimension(S(5), 3));
}

/// Of a point and a match that is 2 px from it.
template <class Camera>
void ray_distances(const Camera& camera, const SE3<typename Camera::ScalarType>& T,
                   Record<typename Camera::ScalarType>& out) {
  using S = typename Camera::ScalarType;
  using Matrix3 = Eigen::Matrix<S, 3, 3>;
  const std::string name = ConformanceCamera<Camera>::name;
  const Eigen::Matrix<S, 3, 1> p(S(0.3), S(-0.2), S(2.5));
  const auto x_m = camera.project(T * p);
  REQUIRE(x_m.has_value());
  const auto a = pixel_ray(camera, p);
  const auto b = pixel_ray_at(camera, Eigen::Matrix<S, 2, 1>((*x_m)[0] + S(1.2), (*x_m)[1] - S(1.6)));
  REQUIRE((a.has_value() && b.has_value()));
  out.put(name + ".pixel_ray", a->ray);
  out.put(name + ".pixel_ray.derivative", a->J);
  const Matrix3 R = T.rotation_matrix(), E = detail::product<S>(SO3<S>::hat(T.translation()), R);
  out.put(name + ".epipolar_distance", epipolar_distance(E, *a, *b));
  out.put(name + ".sampson_of_rays", sampson_distance_squared(E, *a, *b));
  out.put(name + ".transfer_of_rays", transfer_distance_squared(R, *a, *b));
}

template <Scalar S>
void two_views(const SE3<S>& T, Record<S>& out) {
  using Vector2 = Eigen::Matrix<S, 2, 1>;
  const auto camera = conformance_camera<Pinhole<S>>();
  const Eigen::Matrix<S, 3, 3> F = fundamental_from_pose(camera, camera, T);
  const Vector2 x(S(70), S(52)), x_m(S(88), S(63));
  out.put("fundamental_from_pose", F);
  out.put("epipolar_line", epipolar_line(F, x));
  out.put("line_distance", line_distance(F, x, x_m));
  out.put("sampson", sampson_distance_squared(F, x, x_m));
  const Eigen::Matrix<S, 3, 3> H = camera.K() * T.rotation_matrix() * ideal_pinhole(camera).K().inverse();
  const Eigen::Matrix<S, 3, 3> H_inverse = H.inverse();
  const auto there = transfer(H, x);
  REQUIRE(there.has_value());
  out.put("transfer", *there);
  out.put("transfer_distance", transfer_distance_squared(H, x, x_m));
  out.put("symmetric_transfer_distance", symmetric_transfer_distance_squared(H, H_inverse, x, x_m));
  Eigen::Matrix<S, 6, 6> J_i = Eigen::Matrix<S, 6, 6>::Zero(), J_j = J_i;
  out.put("pose_graph_residual", pose_graph_residual(T, T * T, reference_pose<S>(), &J_i, &J_j));
  out.put("pose_graph_residual.i", J_i);
  out.put("pose_graph_residual.j", J_j);
}

}  // namespace conformance

/// Everything that is a function of numbers, as a function of the left increment of a pose, in two parts (to
/// be compiled apart).
struct CameraFunctions {
  template <Scalar S>
  [[nodiscard]] static Record<S> results(const Eigen::Matrix<S, 6, 1>& delta) {
    Record<S> out;
    const SE3<S> T = SE3<S>::exp(delta) * conformance::reference_pose<S>();
    conformance::projections(conformance_camera<Pinhole<S>>(), T, out);
    conformance::ray_distances(conformance_camera<Pinhole<S>>(), T, out);
    conformance::projections(conformance_camera<PinholeBrownConrady<S>>(), T, out);
    conformance::ray_distances(conformance_camera<PinholeBrownConrady<S>>(), T, out);
    conformance::projections(conformance_camera<KannalaBrandt<S>>(), T, out);
    conformance::ray_distances(conformance_camera<KannalaBrandt<S>>(), T, out);
    conformance::projections(conformance_camera<AnyCamera<S>>(), T, out);
    conformance::ray_distances(conformance_camera<AnyCamera<S>>(), T, out);
    conformance::projections(conformance_camera<EquidistantCamera<S>>(), T, out);
    conformance::ray_distances(conformance_camera<EquidistantCamera<S>>(), T, out);
    return out;
  }
};
struct OtherFunctions {
  template <Scalar S>
  [[nodiscard]] static Record<S> results(const Eigen::Matrix<S, 6, 1>& delta) {
    Record<S> out;
    const SE3<S> T = SE3<S>::exp(delta) * conformance::reference_pose<S>();
    conformance::motions(T, out);
    conformance::errors_and_weights(T, out);
    conformance::two_views(T, out);
    const std::uint8_t bytes[4] = {0, 7, 200, 255};
    out.put("widen", widen<S, 4>(bytes).matrix());
    return out;
  }
};

/// float and double agree.
template <class Functions>
void check_float() {
  check_same(Functions::template results<float>(Eigen::Matrix<float, 6, 1>::Zero()),
             Functions::template results<double>(Eigen::Matrix<double, 6, 1>::Zero()), 2e-3);
}

/// A dual number's values are those of double, its derivatives the central differences of double.
/// @param variable  variable(k) -> S: zero, the k-th variable of six
/// @param derivative  derivative(x, k) -> double
template <class Functions, Scalar S, class Variable, class Derivative>
void check_dual_numbers(Variable&& variable, Derivative&& derivative) {
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  Eigen::Matrix<S, 6, 1> delta;
  for (int k = 0; k < 6; ++k) delta(k) = variable(k);
  const Record<S> found = Functions::template results<S>(delta);
  check_same(found, Functions::template results<double>(Vector6::Zero()), 1e-9);
  constexpr double kStep = 1e-6;
  for (int k = 0; k < 6; ++k) {
    const Vector6 step = kStep * Vector6::Unit(k);
    const auto after = Functions::template results<double>(step),
               before = Functions::template results<double>(-step);
    for (std::size_t i = 0; i < found.size(); ++i) {
      CAPTURE(k);
      CAPTURE(found.name(i));
      const double expected = (after.value(i) - before.value(i)) / (2 * kStep);
      CAPTURE(expected);
      CAPTURE(derivative(found.value(i), k));
      CHECK(distance_of(derivative(found.value(i), k), expected) < 1e-4);
    }
  }
}

}  // namespace dynslam::test
