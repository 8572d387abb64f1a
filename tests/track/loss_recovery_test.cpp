// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/track/loss_recovery.hpp"

#include <doctest/doctest.h>

#include "dynslam/geometry/pinhole.hpp"
#include "tracked_wall.hpp"

using namespace dynslam;

namespace {

/// The views 2 to 4 were lost; 5 ends the loss.
template <class S>
struct LossBeforeWall : test::TrackedWall<Pinhole<S>> {
  using Wall = test::TrackedWall<Pinhole<S>>;
  LossRecovery<Pinhole<S>, typename Wall::Pyramid> recovery;
  FeatureFrame<S> now;

  explicit LossBeforeWall(bool blind = false, const PoseTrackingOptions<S>& o = {})
      : Wall(Pinhole<S>(S(130), S(131), S(79.5), S(59.5)), o), recovery(o) {
    this->start();
    for (int k = 2; k < 5; ++k) {
      auto at = this->view(k);
      PoseEstimate<S> lost;
      if (blind) {
        at.depth = Image<float>(this->kWidth, this->kHeight, 0.0F);
        at.pyramid.build(Image<std::uint8_t>(this->kWidth, this->kHeight, 30), 2);
      } else {
        this->see(at, lost);
      }
      if (recovery.keeps(this->last))
        recovery.remember(this->last, at.time, at.pyramid, at.depth, lost.frame);
      else
        recovery.forget();
      this->last.lose();
    }
    const auto end = this->view(5);
    now.t = end.time.t;
    now.T_c_w = end.T_c_w;
    this->last.accept(now.T_c_w, now.t);
  }
  std::vector<FoundFrame<S>> recover() { return recovery.recover(this->map, this->last, now, this->solver); }
};

}  // namespace

TEST_CASE_TEMPLATE("frames of a loss are found once the camera is known on both sides of it", S, float,
                   double) {
  LossBeforeWall<S> wall;
  const auto points = wall.map.points();
  const auto found = wall.recover();
  REQUIRE(found.size() == 3);
  for (int k = 2; k < 5; ++k) {
    const auto& frame = found[static_cast<std::size_t>(k - 2)];
    CHECK(frame.time.ns == 100 + k);
    CHECK(wall.error(frame.pose.T_c_w, wall.view(k)) < S(0.004));
  }
  // The last of them tells how the camera moves, and no point is worse for having been looked for.
  CHECK(wall.last.velocity_interval() == doctest::Approx(wall.kInterval));
  CHECK((wall.last.velocity() * found.back().pose.T_c_w * wall.now.T_c_w.inverse()).log().norm() < S(1e-5));
  for (std::size_t p = 0; p < points.size(); ++p) {
    CHECK(wall.map.points()[p].visible == points[p].visible);
    CHECK(wall.map.points()[p].found == points[p].found);
  }
  CHECK(wall.recover().empty());  // once
}

TEST_CASE("poses are never made up, and a loss that is too long is given up") {
  CHECK(LossBeforeWall<double>(true).recover().empty());
  PoseTrackingOptions<double> two;
  two.recovered_frames = 2;
  CHECK(LossBeforeWall<double>(false, two).recover().empty());
}
