// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/dynamics/motion_segmenter.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>

#include "dynslam/geometry/brown_conrady.hpp"
#include "dynslam/geometry/pinhole.hpp"
#include "dynslam/segment/mask.hpp"
#include "equidistant_camera.hpp"
#include "moving_scene.hpp"

using namespace dynslam;
using test::ColumnImage;
using test::MovingScene;
using test::SceneRenderer;

namespace {

constexpr int kWidth = 240, kHeight = 180;

/// Intersection over union of two masks.
double overlap(const Image<std::uint8_t>& a, const Image<std::uint8_t>& b) {
  int both = 0, either = 0;
  for (int v = 0; v < a.height(); ++v) {
    for (int u = 0; u < a.width(); ++u) {
      both += a(u, v) != 0 && b(u, v) != 0 ? 1 : 0;
      either += a(u, v) != 0 || b(u, v) != 0 ? 1 : 0;
    }
  }
  return either > 0 ? static_cast<double>(both) / either : 1.0;
}

double share(const Image<std::uint8_t>& a) {
  int n = 0;
  for (int v = 0; v < a.height(); ++v) {
    for (int u = 0; u < a.width(); ++u) n += a(u, v) != 0 ? 1 : 0;
  }
  return static_cast<double>(n) / (a.width() * a.height());
}

SE3<double> camera_at(int frame) {
  return SE3<double>(SO3<double>::exp(Eigen::Vector3d(0, 0.002 * frame, 0.001 * frame)),
                     Eigen::Vector3d(0.004 * frame, -0.002 * frame, 0));
}

/// Takes the texture from what moves, but for the upper two fifths.
void make_mostly_plain(const Image<std::uint8_t>& moving, Image<std::uint8_t>& gray) {
  int top = gray.height(), bottom = 0;
  for (int v = 0; v < gray.height(); ++v) {
    for (int u = 0; u < gray.width(); ++u) {
      if (moving(u, v) == 0) continue;
      top = std::min(top, v);
      bottom = std::max(bottom, v);
    }
  }
  for (int v = top + 2 * (bottom - top) / 5; v <= bottom; ++v) {
    for (int u = 0; u < gray.width(); ++u) {
      if (moving(u, v) != 0) gray(u, v) = 128;
    }
  }
}

struct Outcome {
  double overlap = 0, still_share = 0;  // means over the last frames
  bool wall_verified = false;
};

/// Runs a segmenter over a board that starts to move after half a second, with the true poses.
template <class Camera>
Outcome run(const Camera& camera, double speed,
            const MotionSegmenterOptions<typename Camera::ScalarType>& options) {
  using S = typename Camera::ScalarType;
  MotionSegmenter<S, Camera> segmenter(camera, options);
  SceneRenderer<Camera> view(camera, kWidth, kHeight);
  MovingScene scene;
  scene.board.x() = -0.55;
  Outcome outcome;
  constexpr int kFrames = 36, kLast = 8;
  for (int k = 0; k < kFrames; ++k) {
    if (k > 15) scene.board.x() += speed / 30;
    view.render(scene, camera_at(k));
    const SE3<S> T_c_w = camera_at(k).inverse().template cast<S>();
    const auto& motion =
        segmenter.segment(ColumnImage<std::uint8_t>(view.gray), view.depth.view(), k / 30.0, T_c_w);
    REQUIRE(motion.ok());
    if (k >= kFrames - kLast) {
      outcome.overlap += overlap(motion.mask, view.moving) / kLast;
      outcome.still_share += share(motion.mask) / kLast;
    }
    outcome.wall_verified = segmenter.verified_static(kWidth / 2.0F, 12.0F);
    segmenter.remember(T_c_w, motion.mask);
  }
  return outcome;
}

}  // namespace

TEST_CASE_TEMPLATE("a carried board is found, and a room at rest stays out of the mask", S, float, double) {
  const Pinhole<S> camera(S(200), S(200), S(119.5), S(89.5));
  const Outcome moving = run(camera, 1.5, {});
  CHECK(moving.overlap > 0.8);
  CHECK(moving.wall_verified);
  const Outcome still = run(camera, 0.0, {});
  CHECK(still.still_share < 0.002);
}

TEST_CASE_TEMPLATE("without any pose, the room locates the camera and the board is found", S, float, double) {
  const Pinhole<S> camera(S(200), S(200), S(119.5), S(89.5));
  MotionSegmenter<S, Pinhole<S>> segmenter(camera);
  SceneRenderer<Pinhole<S>> view(camera, kWidth, kHeight);
  MovingScene scene;
  scene.board.x() = -0.55;
  SE3<S> last = camera_at(0).inverse().template cast<S>(), velocity;
  double found = 0;
  for (int k = 0; k < 36; ++k) {
    if (k > 4) scene.board.x() += 1.2 / 30;
    view.render(scene, camera_at(k));
    const auto located = segmenter.locate(view.gray.view(), view.depth.view(), velocity * last);
    CHECK(located.ok() == (k > 0));  // the first frame is where it is said to be
    const auto& motion = segmenter.segment(view.gray.view(), view.depth.view(), k / 30.0, located.T_c_w);
    segmenter.remember(located.T_c_w, motion.mask);
    velocity = located.T_c_w * last.inverse();
    last = located.T_c_w;
    const SE3<double> error = located.T_c_w.template cast<double>() * camera_at(k);
    CHECK(error.translation().norm() < 0.01);
    if (k >= 28) found += overlap(motion.mask, view.moving) / 8;
  }
  CHECK(found > 0.7);
  const Image<float> other(kWidth, kHeight + 1, 1.0F);
  CHECK(segmenter.locate(view.gray.view(), other, last).status == PoseConsensusStatus::bad_input);
}

TEST_CASE_TEMPLATE("a board is found through lenses that the segmenter knows nothing of", S, float, double) {
  const PinholeBrownConrady<S> lens(Pinhole<S>(S(200), S(200), S(119), S(90)),
                                    BrownConrady<S>(S(-0.2), S(0.05), S(0.001), S(0), S(0)));
  CHECK(run(lens, 1.5, {}).overlap > 0.8);
  const test::EquidistantCamera<S> fisheye{S(150), S(119.5), S(89.5)};
  CHECK(run(fisheye, 1.5, {}).overlap > 0.8);
  CHECK(run(fisheye, 0.0, {}).still_share < 0.002);
}

TEST_CASE("the paper's path alone finds the board by its keypoints") {
  const Pinhole<double> camera(200, 200, 119.5, 89.5);
  MotionSegmenterOptions<double> options;
  options.method = MotionMethod::paper;
  const Outcome moving = run(camera, 1.5, options);
  CHECK(moving.overlap > 0.6);
  CHECK_FALSE(moving.wall_verified);
}

TEST_CASE("images of another size are refused, not read beyond their end") {
  const Pinhole<double> camera(200, 200, 119.5, 89.5);
  MotionSegmenter<double, Pinhole<double>> segmenter(camera);
  const Image<std::uint8_t> gray(kWidth, kHeight), small(60, 40);
  const Image<float> depth(kWidth, kHeight, 2.0F), small_depth(60, 40, 2.0F);
  CHECK_FALSE(segmenter.segment(gray, small_depth, 0, SE3<double>()).ok());
  CHECK(segmenter.segment(gray, depth, 0, SE3<double>()).ok());
  CHECK_FALSE(segmenter.segment(small, small_depth, 0, SE3<double>()).ok());
  CHECK_FALSE(segmenter.segment(gray, depth, 0, SE3<double>(), small).ok());
  CHECK(segmenter.segment(gray, depth, 0, SE3<double>(), gray).ok());
  segmenter.remember(SE3<double>(), small);  // a mask of another size says nothing
}

TEST_CASE("a correction of the map moves what is remembered with it") {
  const Pinhole<double> camera(200, 200, 119.5, 89.5);
  MotionSegmenter<double, Pinhole<double>> segmenter(camera);
  SceneRenderer<Pinhole<double>> view(camera, kWidth, kHeight);
  const SE3<double> D(SO3<double>::exp(Eigen::Vector3d(0.1, 0.3, -0.2)), Eigen::Vector3d(1.0, -2.0, 0.5));
  for (int k = 0; k < 24; ++k) {
    if (k == 16) segmenter.follow(D);
    view.render({}, camera_at(k));
    SE3<double> T_c_w = camera_at(k).inverse();
    if (k >= 16) T_c_w = T_c_w * D;
    const auto& motion = segmenter.segment(view.gray, view.depth, k / 30.0, T_c_w);
    CHECK(share(motion.mask) < 0.01);
    CHECK(motion.dynamic_matches <= motion.tracked / 20);
    segmenter.remember(T_c_w, motion.mask);
  }
}

TEST_CASE_TEMPLATE(
    "depth images taken beside the grey ones make no moving objects, where the way between is told", S, float,
    double) {
  const Pinhole<S> camera(S(200), S(200), S(119.5), S(89.5));
  const auto at = [](double k) {
    return SE3<double>(SO3<double>::exp(Eigen::Vector3d(0, 0.3 * std::sin(0.2 * k), 0)),
                       Eigen::Vector3d(0.1 * std::sin(0.2 * k), 0, 0));
  };
  const auto mean_share = [&](bool told) {
    MotionSegmenterOptions<S> options;
    options.belief.free_space.depth_time_uncertainty = 0;  // what is left of it is for what is unknown
    MotionSegmenter<S, Pinhole<S>> segmenter(camera, options);
    SceneRenderer<Pinhole<S>> grey(camera, kWidth, kHeight), depth(camera, kWidth, kHeight);
    const MovingScene scene;
    double mean = 0;
    for (int k = 0; k < 40; ++k) {
      const double delay = 0.8 * (k % 3 - 1);  // frames
      grey.render(scene, at(k));
      depth.render(scene, at(k + delay));
      const SE3<S> T_c_w = at(k).inverse().template cast<S>();
      if (told) segmenter.set_depth_motion((at(k + delay).inverse() * at(k)).template cast<S>());
      const auto& motion = segmenter.segment(grey.gray.view(), depth.depth.view(), k / 30.0, T_c_w);
      mean += share(motion.mask) / 40;
      segmenter.remember(T_c_w, motion.mask.view());
    }
    return mean;
  };
  const double blind = mean_share(false), told = mean_share(true);
  CAPTURE(blind);
  CHECK(blind > 0.01);
  CHECK(told < 0.5 * blind);
}

TEST_CASE_TEMPLATE("a board that slides in its plane from the first frame on is found whole", S, float,
                   double) {
  // Its depth stays what it was, so the depth check takes all but its leading edge for verified; its texture
  // tells.
  const Pinhole<S> camera{S(230), S(230), S(119.5), S(89.5)};
  const auto found = [&](bool mostly_plain) {
    MotionSegmenterOptions<S> options;
    MotionSegmenter<S, Pinhole<S>> segmenter(camera, options);
    SceneRenderer<Pinhole<S>> view(camera, kWidth, kHeight);
    MovingScene scene;
    double overlaps = 0;
    constexpr int kFrames = 12, kLast = 6;
    for (int k = 0; k < kFrames; ++k) {
      view.render(scene, camera_at(k));
      if (mostly_plain) make_mostly_plain(view.moving, view.gray);
      const SE3<S> T_c_w = camera_at(k).inverse().template cast<S>();
      const auto& motion = segmenter.segment(view.gray.view(), view.depth.view(), k / 30.0, T_c_w);
      if (k >= kFrames - kLast) overlaps += overlap(motion.mask, view.moving) / kLast;
      segmenter.remember(T_c_w, motion.mask);
      scene.board.x() += 0.012;
    }
    return overlaps;
  };
  CHECK(found(false) > 0.85);
  CHECK(found(true) > 0.85);  // its outline is evidence for all of it, textured or not
}

TEST_CASE_TEMPLATE("a board that has most of the keypoints is found whole within a second", S,
                   float, double) {
  const Pinhole<S> camera{S(230), S(230), S(119.5), S(89.5)};
  const auto found = [&](int frames) {
    MotionSegmenterOptions<S> options;
    MotionSegmenter<S, Pinhole<S>> segmenter(camera, options);
    SceneRenderer<Pinhole<S>> view(camera, kWidth, kHeight);
    MovingScene scene;
    scene.half = 0.55;
    scene.standing.x() = 2;  // out of view
    double result = 0;
    for (int k = 0; k < frames; ++k) {
      view.render(scene, camera_at(k));
      const SE3<S> T_c_w = camera_at(k).inverse().template cast<S>();
      const auto& motion = segmenter.segment(view.gray.view(), view.depth.view(), k / 30.0, T_c_w);
      result = overlap(motion.mask, view.moving);
      segmenter.remember(T_c_w, motion.mask);
      scene.board.x() += 0.04;
    }
    return result;
  };
  CHECK(found(24) > 0.85);
}

TEST_CASE_TEMPLATE(
    "the foreground is marked before a frame is segmented, and changes nothing of what is found", S, float,
    double) {
  const Pinhole<S> camera{S(230), S(230), S(119.5), S(89.5)};
  SceneRenderer<Pinhole<S>> view(camera, kWidth, kHeight);
  MotionSegmenter<S, Pinhole<S>> asked(camera), other(camera);
  MovingScene scene;
  for (int k = 0; k < 8; ++k) {
    view.render(scene, camera_at(k));
    Image<std::uint8_t> foreground(kWidth, kHeight, 0), boards(kWidth, kHeight, 0);
    REQUIRE(asked.mark_foreground(view.depth.view(), foreground.view()));
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) boards(u, v) = view.depth(u, v) < 2.5F ? 255 : 0;
    }
    CHECK(overlap(foreground, boards) > 0.9);
    const SE3<S> T_c_w = camera_at(k).inverse().template cast<S>();
    const auto& a = asked.segment(view.gray.view(), view.depth.view(), k / 30.0, T_c_w);
    const auto& b = other.segment(view.gray.view(), view.depth.view(), k / 30.0, T_c_w);
    CHECK(overlap(a.mask, b.mask) == 1.0);
    asked.remember(T_c_w, a.mask);
    other.remember(T_c_w, b.mask);
    scene.board.x() += 0.012;
  }
  Image<std::uint8_t> small(kWidth / 2, kHeight, 0);
  CHECK_FALSE(asked.mark_foreground(view.depth.view(), small.view()));
  const Image<float> other_size(kWidth, kHeight / 2, 1.0F);
  Image<std::uint8_t> out(kWidth, kHeight / 2, 0);
  CHECK_FALSE(asked.mark_foreground(other_size.view(), out.view()));
}

TEST_CASE_TEMPLATE("the rim of a board makes no mover of the wall behind it", S, float, double) {
  // Depth cameras see edges some pixels beside those of the grey image: texture of the board lies on the
  // wall.
  const Pinhole<S> camera{S(230), S(230), S(119.5), S(89.5)};
  const auto of_the_wall = [&] {
    MotionSegmenter<S, Pinhole<S>> segmenter(camera);
    SceneRenderer<Pinhole<S>> view(camera, kWidth, kHeight);
    MovingScene scene;
    double worst = 0;
    for (int k = 0; k < 12; ++k) {
      view.render(scene, camera_at(k));
      Image<std::uint8_t> inside(kWidth, kHeight), around(kWidth, kHeight);
      MaskWorkspace workspace;
      erode(view.moving.view(), inside.view(), 3, workspace);
      dilate(view.moving.view(), around.view(), 3, workspace);
      for (int v = 0; v < kHeight; ++v) {
        for (int u = 0; u < kWidth; ++u) {
          if (view.moving(u, v) != 0 && inside(u, v) == 0) view.depth(u, v) = 3;
        }
      }
      const SE3<S> T_c_w = camera_at(k).inverse().template cast<S>();
      const auto& motion = segmenter.segment(view.gray.view(), view.depth.view(), k / 30.0, T_c_w);
      int wrong = 0;
      for (int v = 0; v < kHeight; ++v) {
        for (int u = 0; u < kWidth; ++u) wrong += motion.mask(u, v) != 0 && around(u, v) == 0 ? 1 : 0;
      }
      worst = std::max(worst, static_cast<double>(wrong) / (kWidth * kHeight));
      segmenter.remember(T_c_w, motion.mask);
      scene.board.x() += 0.012;
    }
    return worst;
  };
  CHECK(of_the_wall() < 0.001);
}
