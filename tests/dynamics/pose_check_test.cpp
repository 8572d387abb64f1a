// SPDX-License-Identifier: BSD-3-Clause
// Hosts whose poses are not to be believed.
#include "dynslam/dynamics/pose_check.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <tuple>
#include <utility>

#include "dynslam/dynamics/motion_segmenter.hpp"
#include "dynslam/geometry/pinhole.hpp"
#include "moving_scene.hpp"

using namespace dynslam;
using test::MovingScene;
using test::SceneRenderer;

namespace {

constexpr int kWidth = 240, kHeight = 180;
using Camera = Pinhole<double>;
using Segmenter = MotionSegmenter<double, Camera>;

struct Guest {
  Camera camera{200, 200, 119.5, 89.5};
  Segmenter segmenter;
  SceneRenderer<Camera> view{camera, kWidth, kHeight};
  MovingScene scene;
  explicit Guest(const MotionSegmenterOptions<double>& options = {}) : segmenter(camera, options) {
    scene.board.x() = -0.55;
  }
  static SE3<double> camera_at(int frame) {
    return SE3<double>(SO3<double>::exp(Eigen::Vector3d(0, 0.002 * frame, 0.001 * frame)),
                       Eigen::Vector3d(0.004 * frame, -0.002 * frame, 0));
  }
  const MotionResult<double>& step(int frame, const SE3<double>& T_c_w) {
    view.render(scene, camera_at(frame));
    const auto& motion = segmenter.segment(view.gray.view(), view.depth.view(), frame / 30.0, T_c_w);
    segmenter.remember(T_c_w, motion.mask);
    return motion;
  }
  /// Pixels of the mask on the board and beside it, as shares of the board.
  [[nodiscard]] std::pair<double, double> on_and_beside() const {
    double board = 0, on = 0, beside = 0;
    const auto& mask = segmenter.motion().mask;
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) {
        board += view.moving(u, v) != 0 ? 1 : 0;
        if (mask(u, v) != 0) ++(view.moving(u, v) != 0 ? on : beside);
      }
    }
    return {on / board, beside / board};
  }
};

/// A host whose camera goes with the board by a share of its way, from frame 12 on.
struct Pulled {
  double on = 0, beside = 0;  // as of on_and_beside()
  int own = 0;                // frames with a pose of the segmenter's own
  double off_truth = 0;       // of the poses that the masks rest on, the worst [m]
};
Pulled with_pulled_poses(const MotionSegmenterOptions<double>& options) {
  Guest guest(options);
  double pull = 0;
  Pulled result;
  for (int k = 0; k < 22; ++k) {
    if (k > 12) {
      guest.scene.board.x() += 1.5 / 30;
      pull += 0.4 * 1.5 / 30;
    }
    const SE3<double> T_w_c = Guest::camera_at(k);
    const auto& motion = guest.step(k, T_w_c.inverse() * SE3<double>(SO3<double>(), Eigen::Vector3d(pull, 0, pull / 2)));
    result.own += motion.own_pose ? 1 : 0;
    result.off_truth = std::max(result.off_truth, (T_w_c * motion.T_c_w).translation().norm());
  }
  std::tie(result.on, result.beside) = guest.on_and_beside();
  return result;
}

}  // namespace

TEST_CASE("a host's pose that goes with what moves is not believed, and what moves is found all the same") {
  const Pulled checked = with_pulled_poses({});
  CHECK(checked.on > 0.9);
  CHECK(checked.beside < 0.05);
  CHECK(checked.own >= 8);           // of nine frames
  CHECK(checked.off_truth < 0.03);  // the host is 20 cm off in the end
  MotionSegmenterOptions<double> trusting;
  trusting.pose_check.use = false;
  const Pulled trusted = with_pulled_poses(trusting);
  CHECK(trusted.on < 0.5);
  CHECK(trusted.own == 0);
  CHECK(trusted.off_truth > 0.15);
}

TEST_CASE("a host's true pose is believed, and its mask is the same as without a check") {
  MotionSegmenterOptions<double> trusting;
  trusting.pose_check.use = false;
  Guest checked, unchecked(trusting);
  for (int k = 0; k < 36; ++k) {
    for (Guest* guest : {&checked, &unchecked}) {
      if (k > 12) guest->scene.board.x() += 1.5 / 30;
      CHECK_FALSE(guest->step(k, Guest::camera_at(k).inverse()).own_pose);
    }
    const auto &a = checked.segmenter.motion().mask, &b = unchecked.segmenter.motion().mask;
    CHECK(std::equal(a.data(), a.data() + kWidth * kHeight, b.data()));
  }
}

TEST_CASE("a host that has jumped is followed by its motion, and the static room stays out of the mask") {
  Guest guest;
  for (int k = 0; k < 20; ++k) REQUIRE(guest.step(k, Guest::camera_at(k).inverse()).ok());
  const SE3<double> elsewhere(SO3<double>(), Eigen::Vector3d(0, 0, 0.6));  // a step back that was none
  for (int k = 20; k < 60; ++k) {
    if (k > 45) guest.scene.board.x() += 1.5 / 30;
    CHECK(guest.step(k, Guest::camera_at(k).inverse() * elsewhere).ok());
    const auto [on, beside] = guest.on_and_beside();
    if (k <= 45) CHECK(on + beside < 0.05);  // nothing moves
    if (k == 59) CHECK(on > 0.7);
  }
}

TEST_CASE("a view of which nothing is known to stand is refused, and forgotten when that lasts") {
  Guest guest;
  for (int k = 0; k < 20; ++k) REQUIRE(guest.step(k, Guest::camera_at(k).inverse()).ok());
  // Another room, half as far away, behind the same pose: no keypoint is found again, all of the view is new.
  guest.view.render(guest.scene, Guest::camera_at(20));
  Image<float> near = guest.view.depth;
  Image<std::uint8_t> other(kWidth, kHeight);
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      near(u, v) *= 0.5F;
      other(u, v) = static_cast<std::uint8_t>(128 + 60 * std::sin(0.9 * u) * std::sin(0.7 * v));
    }
  }
  int refused = 0, k = 20;
  for (; k < 60; ++k) {
    const auto& motion = guest.segmenter.segment(other.view(), near.view(), k / 30.0, Guest::camera_at(20).inverse());
    guest.segmenter.remember(Guest::camera_at(20).inverse(), motion.mask);
    refused += motion.status == MotionStatus::covers_view ? 1 : 0;
    const auto masked = std::count_if(motion.mask.data(), motion.mask.data() + kWidth * kHeight, [](auto m) { return m != 0; });
    CHECK(static_cast<double>(masked) < 0.8 * kWidth * kHeight);
    if (refused > 0 && motion.ok()) break;
  }
  CHECK(refused > 0);
  CHECK(k < 50);  // within a second
}

TEST_CASE("one refused frame costs a host neither its reference keyframe nor what was seen") {
  Guest guest;
  for (int k = 0; k < 20; ++k) REQUIRE(guest.step(k, Guest::camera_at(k).inverse()).ok());
  const ReferenceKeypoint<double> one{Eigen::Vector2d(60, 60), 3.0};
  guest.segmenter.set_reference(std::span(&one, 1), Guest::camera_at(19).inverse());
  Image<float> near = guest.view.depth;
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) near(u, v) *= 0.5F;
  }
  CHECK(guest.segmenter.segment(guest.view.gray.view(), near.view(), 1.0, Guest::camera_at(19).inverse()).status ==
        MotionStatus::covers_view);
  CHECK(guest.segmenter.has_reference());
}

TEST_CASE("after reset() nothing is left of what was seen") {
  Guest guest;
  for (int k = 0; k < 20; ++k) REQUIRE(guest.step(k, Guest::camera_at(k).inverse()).ok());
  guest.segmenter.reset();
  CHECK_FALSE(guest.segmenter.has_reference());
  CHECK(guest.step(0, SE3<double>()).ok());  // also with an earlier time
  CHECK(guest.segmenter.motion().tracked == 0);
}
