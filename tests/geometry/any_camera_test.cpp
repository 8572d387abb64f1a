// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/geometry/any_camera.hpp"

#include <doctest/doctest.h>

#include "dynslam/geometry/ideal_pinhole.hpp"
#include "random.hpp"

using namespace dynslam;

namespace {

/// The camera behind AnyCamera does what it does alone, bit for bit, over pixels in and beyond an image.
template <class Camera>
void check_same(const Camera& camera) {
  using S = typename Camera::ScalarType;
  const AnyCamera<S> any(camera);
  CHECK(any.pinhole() == ideal_pinhole(camera));
  const auto pinhole = any.pinhole();
  test::Rng rng("any camera");
  int seen = 0;
  for (int k = 0; k < 500; ++k) {
    const Eigen::Matrix<S, 2, 1> x(S(rng.uniform(-100, 740)), S(rng.uniform(-100, 580)));
    const Eigen::Matrix<S, 3, 1> p(S(rng.uniform(-3, 3)), S(rng.uniform(-3, 3)), S(rng.uniform(-0.5, 3)));
    typename AnyCamera<S>::Jacobian J = AnyCamera<S>::Jacobian::Zero(), expected = J;
    const auto projected = camera.project(p, &expected);
    CHECK(any.project(p, &J) == projected);
    if (projected) CHECK(J == expected);
    CHECK(any.project(p) == projected);
    CHECK(any.unproject(x, S(1.5)) == camera.unproject(x, S(1.5)));
    CHECK(to_ideal(any, pinhole, x) == to_ideal(camera, pinhole, x));
    CHECK(from_ideal(any, pinhole, x) == from_ideal(camera, pinhole, x));
    CHECK(any.template cast<double>().project(p.template cast<double>()).has_value() ==
          camera.template cast<double>().project(p.template cast<double>()).has_value());
    seen += projected ? 1 : 0;
  }
  CHECK(seen > 50);
}

}  // namespace

TEST_CASE_TEMPLATE("a camera chosen while the program runs is the camera that was chosen", S, float, double) {
  const Pinhole<S> pinhole(S(500), S(505), S(320), S(240));
  const BrownConrady<S> five(S(-0.3), S(0.07), S(0.001), S(-0.002), S(0));
  const BrownConrady<S> eight(S(0.45), S(-2.5), S(0.001), S(0), S(1.45), S(0.33), S(-2.36), S(1.38));
  const KannalaBrandt<S> fisheye(S(300), S(303), S(320), S(240),
                                 Eigen::Matrix<S, 4, 1>(S(-0.02), S(0.005), S(-0.002), S(0.0003)));
  check_same(pinhole);
  check_same(PinholeBrownConrady<S>(pinhole, five));
  check_same(PinholeBrownConrady<S>(pinhole, eight));
  check_same(fisheye);

  CHECK(AnyCamera<S>(pinhole).is_ideal());
  CHECK(AnyCamera<S>(pinhole).brown_conrady() != nullptr);
  CHECK_FALSE(AnyCamera<S>(PinholeBrownConrady<S>(pinhole, eight)).is_ideal());
  const AnyCamera<S> wide(fisheye);
  CHECK_FALSE(wide.is_ideal());
  CHECK(wide.brown_conrady() == nullptr);
  REQUIRE(wide.kannala_brandt() != nullptr);
  CHECK(wide.kannala_brandt()->coefficients() == fisheye.coefficients());
}

TEST_CASE("the field of a fisheye ends where the caller wants, also after a cast") {
  const KannalaBrandt<double> camera(200, 200, 320, 240, Eigen::Vector4d::Zero(), 1.0);
  for (const AnyCamera<float>& narrow :
       {AnyCamera<float>(camera.cast<float>()), AnyCamera<double>(camera).cast<float>()}) {
    CHECK(narrow.kannala_brandt()->max_angle() == 1.0);
    CHECK(narrow.unproject({320 + 199, 240}, 1));
    CHECK_FALSE(narrow.unproject({320 + 201, 240}, 1));
    CHECK(narrow.project({std::tan(0.99F), 0, 1}));
    CHECK_FALSE(narrow.project({std::tan(1.01F), 0, 1}));
  }
}
