// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/geometry/ideal_pinhole.hpp"

#include <doctest/doctest.h>

#include <cmath>

#include "dynslam/geometry/brown_conrady.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

/// A lens of another law, r = 2 f tan(angle / 2), that names no pinhole.
template <Scalar S>
struct Stereographic {
  using ScalarType = S;
  S f, cx, cy;
  using Vector2 = Eigen::Matrix<S, 2, 1>;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  [[nodiscard]] std::optional<Vector2> project(const Vector3& p) const { return project(p, nullptr); }
  [[nodiscard]] std::optional<Vector2> project(const Vector3& p, Eigen::Matrix<S, 2, 3>* J) const {
    const S d = p.norm(), w = d + p.z();
    if (!(S(1e-6) < w)) return std::nullopt;
    const S k = S(2) * f / w;
    if (J != nullptr) {
      const Eigen::Matrix<S, 1, 3> slope = (p / d + Vector3::UnitZ()).transpose() * (-k / w);
      J->row(0) = p.x() * slope;
      J->row(1) = p.y() * slope;
      (*J)(0, 0) += k;
      (*J)(1, 1) += k;
    }
    return Vector2(k * p.x() + cx, k * p.y() + cy);
  }
  [[nodiscard]] std::optional<Vector3> unproject(const Vector2& x, const S& z) const {
    const Vector2 n = (x - Vector2(cx, cy)) / (S(2) * f);  // tan(angle / 2) along the image
    const S r2 = n.squaredNorm();
    if (!(r2 < S(1))) return std::nullopt;  // 90 degrees and more
    const Vector2 m = S(2) / (S(1) - r2) * n;
    return Vector3(m.x() * z, m.y() * z, z);
  }
};
static_assert(DifferentiableCamera<Stereographic<float>> && DifferentiableCamera<Stereographic<double>>);

template <class C>
void check_round_trip(const C& camera, test::Rng& rng, double tolerance) {
  using S = typename C::ScalarType;
  const auto pinhole = ideal_pinhole(camera);
  for (int k = 0; k < 200; ++k) {
    const Eigen::Matrix<S, 2, 1> x(static_cast<S>(rng.uniform(0, 640)), static_cast<S>(rng.uniform(0, 480)));
    const auto ideal = to_ideal(camera, pinhole, x);
    REQUIRE(ideal);
    const auto back = from_ideal(camera, pinhole, *ideal);
    REQUIRE(back);
    CHECK(static_cast<double>((*back - x).norm()) < tolerance);
    // The ray of the ideal pixel is the ray of the recorded one.
    const Eigen::Matrix<S, 3, 1> ray = *camera.unproject(x, S(1));
    CHECK(static_cast<double>((pinhole.ray(*ideal) - ray).norm()) < tolerance);
  }
}

}  // namespace

TEST_CASE_TEMPLATE("ideal pixels of every camera lie on its rays, there and back", S, float, double) {
  test::Rng rng("ideal pinhole");
  const double tolerance = std::is_same_v<S, float> ? 5e-3 : 1e-8;
  const Pinhole<S> pinhole(S(517.3), S(516.5), S(318.6), S(255.3));
  check_round_trip(pinhole, rng, tolerance);
  check_round_trip(PinholeBrownConrady<S>(pinhole), rng, tolerance);
  check_round_trip(
      PinholeBrownConrady<S>(pinhole, BrownConrady<S>(S(0.26), S(-0.95), S(-0.005), S(0.003), S(1.16))), rng,
      tolerance);
  check_round_trip(Stereographic<S>{S(400), S(320), S(240)}, rng, tolerance);
}

TEST_CASE("the ideal pinhole is the camera's own, or tangent on the axis") {
  const Pinhole<double> pinhole(500, 510, 320, 240);
  CHECK(ideal_pinhole(pinhole) == pinhole);
  const PinholeBrownConrady<double> lens(pinhole, BrownConrady<double>(0.2, 0, 0, 0, 0));
  CHECK(ideal_pinhole(lens) == pinhole);
  CHECK(ideal_pinhole(Stereographic<double>{400, 320, 240}) == Pinhole<double>(400, 400, 320, 240));
  // Any other pinhole will do: the pixel is still that of the same ray.
  const Pinhole<double> other(100, 100, 0, 0);
  const Eigen::Vector2d x(500, 400);
  const auto ideal = to_ideal(lens, other, x);
  REQUIRE(ideal);
  CHECK((other.ray(*ideal) - *lens.unproject(x, 1)).norm() < 1e-12);
  CHECK((*from_ideal(lens, other, *ideal) - x).norm() < 1e-9);
}
