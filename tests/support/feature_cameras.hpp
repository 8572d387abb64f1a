// SPDX-License-Identifier: BSD-3-Clause
// Cameras in whose pixels features may be given, each of 640 x 480 pixels and one of them unknown to the
// library.
#pragma once

#include <Eigen/Core>

#include "dynslam/geometry/kannala_brandt.hpp"
#include "dynslam/geometry/pinhole.hpp"
#include "equidistant_camera.hpp"

namespace dynslam::test {

template <class Camera>
struct FeatureCamera;
template <class S>
struct FeatureCamera<Pinhole<S>> {
  static Pinhole<S> make() { return Pinhole<S>(S(525), S(525), S(319.5), S(239.5)); }
};
template <class S>
struct FeatureCamera<KannalaBrandt<S>> {
  static KannalaBrandt<S> make() {
    return KannalaBrandt<S>(S(430), S(432), S(322), S(238),
                            Eigen::Matrix<S, 4, 1>(S(-0.02), S(0.005), S(-0.002), S(0.0003)));
  }
};
template <class S>
struct FeatureCamera<EquidistantCamera<S>> {
  static EquidistantCamera<S> make() { return EquidistantCamera<S>(S(430), S(319.5), S(239.5)); }
};

template <class Camera>
[[nodiscard]] Camera feature_camera() {
  return FeatureCamera<Camera>::make();
}

}  // namespace dynslam::test

/// For TEST_CASE_TEMPLATE: each lens once, the scalars in turn. Every one with both is what tests/conformance
/// runs.
#define DYNSLAM_FEATURE_CAMERAS                                                     \
  dynslam::Pinhole<float>, dynslam::Pinhole<double>, dynslam::KannalaBrandt<float>, \
      dynslam::test::EquidistantCamera<double>
/// Without the pinhole, where that is tested already.
#define DYNSLAM_FISHEYES dynslam::KannalaBrandt<float>, dynslam::test::EquidistantCamera<double>
