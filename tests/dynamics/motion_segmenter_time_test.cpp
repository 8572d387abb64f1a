// SPDX-License-Identifier: BSD-3-Clause
// What MotionSegmenter makes of frames that come at other rates than 30 Hz, with gaps, or out of order.
#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "dynslam/dynamics/motion_segmenter.hpp"
#include "dynslam/geometry/pinhole.hpp"
#include "moving_scene.hpp"

using namespace dynslam;
using test::MovingScene;
using test::SceneRenderer;

namespace {

constexpr int kTimedWidth = 160, kTimedHeight = 120;

/// A board that is carried through a room from a moment on, seen by a camera that drifts and turns.
template <class S>
class TimedScene {
 public:
  explicit TimedScene(const MotionSegmenterOptions<S>& options = {})
      : segmenter(camera(), options), view(camera(), kTimedWidth, kTimedHeight) {}

  /// Looks at it and segments the image. The board moves by 1.5 m/s from `starts` on.
  const MotionResult<S>& look(double t, double starts = std::numeric_limits<double>::infinity()) {
    MovingScene scene;
    scene.board.x() = -0.55 + (t > starts ? 1.5 * (t - starts) : 0);
    const SE3<double> T_w_c(SO3<double>::exp(Eigen::Vector3d(0, 0.04 * t, 0.02 * t)),
                            Eigen::Vector3d(0.08 * t, -0.04 * t, 0));
    view.render(scene, T_w_c);
    T_c_w = T_w_c.inverse().template cast<S>();
    return segmenter.segment(view.gray.view(), view.depth.view(), kEpoch + t, T_c_w);
  }
  void remember() { segmenter.remember(T_c_w, segmenter.motion().mask); }

  /// Share of the image on the mask, and of the board that it covers.
  [[nodiscard]] double masked() const {
    const Image<std::uint8_t>& mask = segmenter.motion().mask;
    int n = 0;
    for (int i = 0; i < kTimedWidth * kTimedHeight; ++i) n += mask.data()[i] != 0 ? 1 : 0;
    return static_cast<double>(n) / (kTimedWidth * kTimedHeight);
  }
  [[nodiscard]] double overlap() const {
    const Image<std::uint8_t>& mask = segmenter.motion().mask;
    int both = 0, either = 0;
    for (int i = 0; i < kTimedWidth * kTimedHeight; ++i) {
      const bool found = mask.data()[i] != 0, moves = view.moving.data()[i] != 0;
      both += found && moves ? 1 : 0;
      either += found || moves ? 1 : 0;
    }
    return static_cast<double>(both) / either;
  }

  MotionSegmenter<S, Pinhole<S>> segmenter;
  SceneRenderer<Pinhole<S>> view;
  SE3<S> T_c_w;

 private:
  static Pinhole<S> camera() { return {S(133), S(133), S(79.5), S(59.5)}; }
  static constexpr double kEpoch = 1.7e9;  // a clock that has run for long [s]
};

/// Times of frames that come again and again after these intervals [s].
struct Rhythm {
  std::string name;
  std::vector<double> intervals;

  [[nodiscard]] std::vector<double> times(double end) const {
    std::vector<double> result{0};
    for (std::size_t k = 0; result.back() < end; ++k)
      result.push_back(result.back() + intervals[k % intervals.size()]);
    return result;
  }
};

std::vector<Rhythm> rhythms() {
  return {{"10 Hz", {0.1}},
          {"30 Hz", {1 / 30.0}},
          {"60 Hz", {1 / 60.0}},
          {"20 and 50 ms", {0.02, 0.05}},
          {"frames missing", {1 / 30.0, 1 / 10.0, 1 / 30.0, 1 / 15.0}}};
}

}  // namespace

TEST_CASE_TEMPLATE("a room at rest is never masked, at whatever rate its frames come", S, float, double) {
  std::vector<Rhythm> all = rhythms();
  all.push_back({"a gap of 2 s", std::vector<double>(24, 1 / 30.0)});
  all.back().intervals.push_back(2);
  all.push_back({"400 Hz", {1 / 400.0}});
  for (const double memory : {FreeSpaceOptions().memory, 10.0, 60.0}) {
    for (const Rhythm& rhythm : all) {
      CAPTURE(memory);
      CAPTURE(rhythm.name);
      MotionSegmenterOptions<S> options;
      options.belief.free_space.memory = memory;
      TimedScene<S> scene(options);
      for (const double t : rhythm.times(rhythm.name == "400 Hz" ? 0.4 : 1.3)) {
        REQUIRE(scene.look(t).ok());
        CHECK(scene.masked() < 0.002);
        scene.remember();
      }
    }
  }
}

TEST_CASE_TEMPLATE("a board is found as soon after it starts, at whatever rate frames come", S, float,
                   double) {
  for (const Rhythm& rhythm : rhythms()) {
    CAPTURE(rhythm.name);
    TimedScene<S> scene;
    constexpr double kStarts = 0.51;
    double found = 0, after = 0;
    int frames = 0;
    for (const double t : rhythm.times(1.2)) {
      REQUIRE(scene.look(t, kStarts).ok());
      if (t > kStarts && scene.overlap() > 0.7 && found == 0) found = t - kStarts;
      if (t > kStarts + 0.3) {
        after += scene.overlap();
        ++frames;
      }
      scene.remember();
    }
    CHECK(found > 0);
    CHECK(found < 0.2);  // two intervals of 0.1 s, and the time in which the board comes clear of the noise
    CHECK(after > 0.8 * frames);
  }
}

TEST_CASE_TEMPLATE("what moved while no frame came is found when one comes", S, float, double) {
  TimedScene<S> scene;
  for (int k = 0; k < 30; ++k) {
    (void)scene.look(k / 30.0);
    scene.remember();
  }
  REQUIRE(scene.look(3.0, 2.4).ok());
  CHECK(scene.overlap() > 0.8);
  CHECK(scene.segmenter.verified_static(kTimedWidth / 2.0F, 8.0F));
}

TEST_CASE_TEMPLATE("a frame whose time is not later than the last one's is refused, and changes nothing", S,
                   float, double) {
  TimedScene<S> scene, other;
  for (int k = 0; k < 24; ++k) {
    const double t = k / 30.0;
    (void)scene.look(t, 0.4);
    (void)scene.look(t, 0.4);  // a frame that is not yet remembered may be segmented again
    CHECK(scene.segmenter.motion().ok());
    (void)other.look(t, 0.4);
    CHECK(scene.masked() == other.masked());
    scene.remember();
    scene.remember();  // the second time there is nothing to remember
    other.remember();
    if (k % 6 != 5) continue;
    for (const double wrong : {t, t - 0.01, t - 0.4, std::numeric_limits<double>::quiet_NaN(),
                               std::numeric_limits<double>::infinity()}) {
      const MotionResult<S>& motion = scene.segmenter.segment(scene.view.gray.view(), scene.view.depth.view(),
                                                        1.7e9 + wrong, scene.T_c_w);
      CHECK(motion.status == MotionStatus::time_not_later);
      CHECK(scene.masked() == 0);
      CHECK(motion.matches.empty());
      CHECK_FALSE(scene.segmenter.verified_static(kTimedWidth / 2.0F, 8.0F));
      scene.remember();
    }
  }
  CHECK(other.overlap() > 0.7);

  // The clock was set back: all that was before is forgotten.
  scene.segmenter.reset();
  CHECK_FALSE(scene.segmenter.has_reference());
  TimedScene<S> young;
  for (int k = 0; k < 24; ++k) {
    CHECK(scene.look(k / 30.0, 0.4).ok());
    CHECK(young.look(k / 30.0, 0.4).ok());
    CHECK(scene.masked() == young.masked());
    scene.remember();
    young.remember();
  }
}
