// SPDX-License-Identifier: BSD-3-Clause
// One camera of each kind, for small images: the library's three and one that it does not know.
#pragma once

#include <Eigen/Core>

#include "dynslam/geometry/any_camera.hpp"
#include "dynslam/geometry/brown_conrady.hpp"
#include "dynslam/geometry/kannala_brandt.hpp"
#include "dynslam/geometry/pinhole.hpp"
#include "equidistant_camera.hpp"

namespace dynslam::test {

inline constexpr int kWidth = 160, kHeight = 120;

template <class Camera>
struct ConformanceCamera;
template <class S>
struct ConformanceCamera<Pinhole<S>> {
  static constexpr const char* name = "pinhole";
  static Pinhole<S> make() { return Pinhole<S>(S(130), S(131), S(79.5), S(59.5)); }
};
template <class S>
struct ConformanceCamera<PinholeBrownConrady<S>> {
  static constexpr const char* name = "brown_conrady";
  static PinholeBrownConrady<S> make() {
    return PinholeBrownConrady<S>(ConformanceCamera<Pinhole<S>>::make(),
                                  BrownConrady<S>(S(-0.2), S(0.05), S(0.001), S(-0.002), S(0)));
  }
};
template <class S>
struct ConformanceCamera<KannalaBrandt<S>> {
  static constexpr const char* name = "kannala_brandt";
  static KannalaBrandt<S> make() {
    return KannalaBrandt<S>(S(120), S(121), S(80), S(60),
                            Eigen::Matrix<S, 4, 1>(S(-0.02), S(0.005), S(-0.002), S(0.0003)));
  }
};
template <class S>
struct ConformanceCamera<AnyCamera<S>> {
  static constexpr const char* name = "any";
  static AnyCamera<S> make() { return ConformanceCamera<KannalaBrandt<S>>::make(); }
};
template <class S>
struct ConformanceCamera<EquidistantCamera<S>> {
  static constexpr const char* name = "own";
  static EquidistantCamera<S> make() { return EquidistantCamera<S>(S(120), S(79.5), S(59.5)); }
};
template <class Camera>
[[nodiscard]] Camera conformance_camera() {
  return ConformanceCamera<Camera>::make();
}

}  // namespace dynslam::test

/// For TEST_CASE_TEMPLATE.
#define DYNSLAM_CONFORMANCE_CAMERAS                                                                        \
  dynslam::Pinhole<float>, dynslam::Pinhole<double>, dynslam::PinholeBrownConrady<float>,                  \
      dynslam::PinholeBrownConrady<double>, dynslam::KannalaBrandt<float>, dynslam::KannalaBrandt<double>, \
      dynslam::test::EquidistantCamera<float>, dynslam::test::EquidistantCamera<double>

/// Every camera and both scalars, where all pairs would double what is compiled: other tests have them.
#define DYNSLAM_CONFORMANCE_EACH_CAMERA                                                    \
  dynslam::Pinhole<float>, dynslam::Pinhole<double>, dynslam::PinholeBrownConrady<double>, \
      dynslam::KannalaBrandt<float>, dynslam::test::EquidistantCamera<double>
