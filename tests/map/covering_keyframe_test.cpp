// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/map/covering_keyframe.hpp"

#include <doctest/doctest.h>

#include <numeric>
#include <vector>

using namespace dynslam;

namespace {

/// A frame that sees points [first, first + count) from x metres.
template <class S>
FeatureFrame<S> frame_of(int first, int count, S x) {
  FeatureFrame<S> f;
  f.T_c_w = SE3<S>(SO3<S>(), Eigen::Matrix<S, 3, 1>(x, S(0), S(0)));
  f.point.resize(static_cast<std::size_t>(count));
  std::iota(f.point.begin(), f.point.end(), first);
  f.features.resize(f.point.size());
  f.descriptors.resize(f.point.size());
  f.dynamic.assign(f.point.size(), 0);
  return f;
}

}  // namespace

TEST_CASE_TEMPLATE("a keyframe stands for a frame that is near it and shows its points", S, float, double) {
  KeyframeMap<S> map;
  for (int p = 0; p < 1000; ++p) (void)map.add_point({});
  (void)map.add_keyframe(frame_of<S>(0, 300, S(0)));
  (void)map.add_keyframe(frame_of<S>(200, 300, S(0.2)));
  (void)map.add_keyframe(frame_of<S>(500, 300, S(0.4)));
  const CoverageOptions<S> options;
  std::vector<int> votes;
  const auto covering = [&](const FeatureFrame<S>& f) { return covering_keyframe(map, f, options, votes); };
  CHECK(covering(frame_of<S>(20, 250, S(0.05))) == 0);
  CHECK(covering(frame_of<S>(190, 250, S(0.15))) == 1);
  CHECK(covering(frame_of<S>(20, 250, S(0.11))) == -1);   // the one that shows the same is too far,
  CHECK(covering(frame_of<S>(0, 300, S(0.2))) == -1);     // the one that is near shows something else
  CHECK(covering(frame_of<S>(20, 170, S(0.05))) == -1);   // half of the keyframe's points is not enough,
  CHECK(covering(frame_of<S>(140, 250, S(0.35))) == -1);  // nor half of the frame's matches
  // Where many keyframes are, a frame finds more than any of them shows: that it finds half of one is enough.
  CHECK(covering(frame_of<S>(0, 700, S(0.05))) == 0);
  CHECK(covering(frame_of<S>(160, 700, S(0.05))) == -1);
  FeatureFrame<S> turned = frame_of<S>(20, 250, S(0));
  turned.T_c_w = SE3<S>(SO3<S>::exp(Eigen::Matrix<S, 3, 1>(0, S(0.16), 0)), turned.T_c_w.translation());
  CHECK(covering(turned) == -1);
  FeatureFrame<S> hidden = frame_of<S>(20, 250, S(0.05));  // by a person who walks by
  std::fill(hidden.dynamic.begin(), hidden.dynamic.begin() + 101, 1);
  CHECK(covering(hidden) == -1);
  (void)map.add_keyframe(frame_of<S>(0, 300, S(0)));
  CHECK(covering(frame_of<S>(20, 250, S(0.05))) == 3);  // of equals the newer one
  (void)map.add_keyframe(frame_of<S>(0, 0, S(0.7)));    // of a keyframe without points nothing is found
  CHECK(covering(frame_of<S>(20, 250, S(0.7))) == -1);
  CHECK(covering_keyframe(KeyframeMap<S>(), frame_of<S>(0, 0, S(0)), options, votes) == -1);
}
