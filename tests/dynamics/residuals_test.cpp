// SPDX-License-Identifier: BSD-3-Clause
// The three errors and the joint weight as functions of the pose, in numbers that carry derivatives.
#include "dynslam/dynamics/residuals.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <unsupported/Eigen/AutoDiff>

#include "dynslam/dynamics/static_weight.hpp"
#include "dynslam/geometry/brown_conrady.hpp"
#include "dynslam/geometry/kannala_brandt.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/image/image.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Dual = Eigen::AutoDiffScalar<Vector6>;

Image<float> waves(double phase) {
  Image<float> image(64, 48);
  for (int v = 0; v < image.height(); ++v) {
    for (int u = 0; u < image.width(); ++u)
      image(u, v) = static_cast<float>(100 + 60 * std::sin(0.21 * u + phase) * std::cos(0.17 * v - phase));
  }
  return image;
}

struct Scene {
  Image<float> reference = waves(0.0), current = waves(0.3), depth = Image<float>(64, 48, 2.03F);
  Eigen::Vector2d x, x_m;
  Eigen::Vector3d p_ref;
  SE3<double> T_cur_ref;
};

/// E_I, E_C, E_D and the weight of Eq (7) under exp(delta) T.
template <class S, class Camera>
std::array<S, 4> evaluate(const Scene& scene, const Camera& camera, const Eigen::Matrix<S, 6, 1>& delta) {
  const SE3<S> T = SE3<S>::exp(delta) * scene.T_cur_ref.cast<S>();
  const Eigen::Matrix<S, 3, 1> p = T * Eigen::Matrix<S, 3, 1>(scene.p_ref.cast<S>());
  const Eigen::Matrix<S, 2, 1> x = scene.x.cast<S>(), x_m = scene.x_m.cast<S>();
  const auto projected = camera.project(p);
  REQUIRE(projected);
  const auto e_i = photometric_residual(scene.reference, x, scene.current, *projected);
  const auto e_d = depth_residual(p, scene.depth, x_m);
  REQUIRE((e_i && e_d));
  const KeypointResiduals<S> e{e_i, reprojection_residual(*projected, x_m), e_d};
  const StaticWeightScales<S> scales{S(6.0), S(0.7), S(0.02)};
  return {*e_i, e.reprojection, *e_d, static_weight<S>(e, scales, S(5.0))};
}

/// Derivatives by the pose of dual numbers against central differences in double.
template <template <class> class Camera>
void check_camera(const char* name, const Camera<double>& camera) {
  test::Rng rng(name);
  int tried = 0;
  for (int k = 0; k < 40; ++k) {
    Scene scene;
    scene.x = Eigen::Vector2d(rng.uniform(16, 48), rng.uniform(12, 36));
    const auto p = camera.unproject(scene.x, rng.uniform(1.5, 2.5));
    REQUIRE(p);
    scene.p_ref = *p;
    Vector6 xi;
    for (int i = 0; i < 6; ++i) xi(i) = rng.uniform(-0.03, 0.03);
    scene.T_cur_ref = SE3<double>::exp(xi);
    const auto x0 = camera.project(scene.T_cur_ref * scene.p_ref);
    REQUIRE(x0);
    // A cell's border is a kink of the interpolant: differences must not reach across it.
    const Eigen::Vector2d inside = *x0 - x0->array().floor().matrix();
    if (inside.minCoeff() < 0.01 || inside.maxCoeff() > 0.99) continue;
    ++tried;
    scene.x_m = *x0 + Eigen::Vector2d(rng.uniform(0.4, 1), rng.uniform(0.4, 1));
    Eigen::Matrix<Dual, 6, 1> delta;
    for (int i = 0; i < 6; ++i) delta(i) = Dual(0.0, 6, i);
    const auto dual = evaluate<Dual>(scene, camera.template cast<Dual>(), delta);
    const auto plain = evaluate<double>(scene, camera, Vector6::Zero());
    constexpr double kStep = 1e-6;
    for (int i = 0; i < 6; ++i) {
      const Vector6 step = kStep * Vector6::Unit(i);
      const auto up = evaluate<double>(scene, camera, step), down = evaluate<double>(scene, camera, -step);
      for (std::size_t e = 0; e < 4; ++e) {
        CAPTURE(e);
        CHECK(dual[e].value() == doctest::Approx(plain[e]).epsilon(1e-12));
        const double difference = (up[e] - down[e]) / (2 * kStep);
        CHECK(std::abs(dual[e].derivatives()(i) - difference) < 1e-4 * (1 + std::abs(difference)));
      }
    }
  }
  CHECK(tried > 30);
}

}  // namespace

TEST_CASE("residuals and joint weight carry derivatives by the pose through every camera") {
  const Pinhole<double> pinhole(50, 51, 31.5, 23.5);
  check_camera<Pinhole>("pinhole", pinhole);
  check_camera<PinholeBrownConrady>(
      "lens", PinholeBrownConrady<double>(pinhole, BrownConrady<double>(0.1, -0.05, 0.002, -0.001, 0.01)));
  check_camera<KannalaBrandt>(
      "fisheye", KannalaBrandt<double>(50, 51, 31.5, 23.5, Eigen::Vector4d(-0.02, 0.004, -0.001, 0)));
}

TEST_CASE_TEMPLATE("errors that cannot be measured are missing, not zero", S, float, double) {
  using Vector2 = Eigen::Matrix<S, 2, 1>;
  const Image<float> gray = waves(0);
  Image<float> depth(64, 48, 2.0F);
  depth(10, 10) = 0;
  CHECK_FALSE(photometric_residual(gray, Vector2(-1, 3), gray, Vector2(3, 3)));
  CHECK_FALSE(photometric_residual(gray, Vector2(3, 3), gray, Vector2(63.5, 3)));
  CHECK_FALSE(depth_residual(Eigen::Matrix<S, 3, 1>(0, 0, 2), depth, Vector2(10, 10)));
  CHECK_FALSE(depth_residual(Eigen::Matrix<S, 3, 1>(0, 0, 2), depth, Vector2(S(-0.6), 10)));
  CHECK_FALSE(depth_residual(Eigen::Matrix<S, 3, 1>(0, 0, 2), depth,
                             Vector2(std::numeric_limits<S>::quiet_NaN(), 10)));
  CHECK(*depth_residual(Eigen::Matrix<S, 3, 1>(0, 0, S(2.5)), depth, Vector2(11, 10)) == S(0.5));
}

TEST_CASE_TEMPLATE("positions may be expressions", S, float, double) {
  using Vector2 = Eigen::Matrix<S, 2, 1>;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  const Image<float> gray = waves(0);
  const Image<float> depth(64, 48, 2.0F);
  const Vector2 x(S(10.5), S(11.25));
  const Vector3 p(S(0.1), S(0.2), S(2.5));
  CHECK(*photometric_residual(gray, 2 * x, gray, p.template head<2>() + x) ==
        *photometric_residual(gray, Vector2(2 * x), gray, Vector2(p.template head<2>() + x)));
  CHECK(reprojection_residual(x + Vector2(S(3), S(4)), x) == doctest::Approx(5.0));
  CHECK(*depth_residual(p + Vector3(S(0), S(0), S(1)), depth, x / 2) == S(1.5));
}
