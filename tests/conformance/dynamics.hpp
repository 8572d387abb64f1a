// SPDX-License-Identifier: BSD-3-Clause
// The search for what moves, over one kind of image and one camera.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "cameras.hpp"
#include "dynslam/dynamics/belief_pooling.hpp"
#include "dynslam/dynamics/depth_grid.hpp"
#include "dynslam/dynamics/free_space.hpp"
#include "dynslam/dynamics/free_space_history.hpp"
#include "dynslam/dynamics/keypoint_regions.hpp"
#include "dynslam/dynamics/locate_reference.hpp"
#include "dynslam/dynamics/motion_method.hpp"
#include "dynslam/dynamics/motion_result.hpp"
#include "dynslam/dynamics/motion_belief.hpp"
#include "dynslam/dynamics/motion_evidence.hpp"
#include "dynslam/dynamics/motion_segmenter.hpp"
#include "dynslam/dynamics/motion_segmenter_options.hpp"
#include "dynslam/dynamics/moved_outlines.hpp"
#include "dynslam/dynamics/pose_check.hpp"
#include "dynslam/dynamics/reference_keyframe.hpp"
#include "dynslam/dynamics/static_weights.hpp"
#include "image_kinds.hpp"
#include "images.hpp"
#include "moving_scene.hpp"
#include "record.hpp"

namespace dynslam::test {

/// Images of a board that is carried past a wall, each pose being known.
template <class Camera>
struct BoardSequence {
  static constexpr int kFrames = 7;
  std::vector<Image<std::uint8_t>> gray, moving;
  std::vector<Image<float>> depth;
  std::vector<SE3<double>> T_w_c;

  BoardSequence() {
    SceneRenderer<Camera> view(conformance_camera<Camera>(), kWidth, kHeight);
    MovingScene scene;
    for (int k = 0; k < kFrames; ++k) {
      T_w_c.emplace_back(SO3<double>::exp(Eigen::Vector3d(0, 0.002 * k, 0)), Eigen::Vector3d(0.01 * k, 0, 0));
      scene.board.x() = k < 2 ? -0.55 : -0.55 + 0.08 * (k - 2);
      view.render(scene, T_w_c.back());
      gray.push_back(view.gray);
      depth.push_back(view.depth);
      moving.push_back(view.moving);
    }
  }
};

/// What the segmenter makes of the sequence, exactly, and how much of the board it found.
template <class Kind, class Camera>
[[nodiscard]] Record<double> segmenter_results(MotionMethod method, double& found_share) {
  using S = typename Camera::ScalarType;
  static const BoardSequence<Camera> sequence;
  MotionSegmenterOptions<S> options;
  options.method = method;
  MotionSegmenter<S, Camera> segmenter(conformance_camera<Camera>(), options);
  Record<double> out;
  int found = 0, there = 0;
  for (std::size_t k = 0; k < sequence.gray.size(); ++k) {
    const auto gray = Kind::make(sequence.gray[k]);
    const auto depth = Kind::make(sequence.depth[k]);
    const auto none = Kind::make(Image<std::uint8_t>(kWidth, kHeight, 0));
    const SE3<S> T_c_w = sequence.T_w_c[k].inverse().template cast<S>();
    auto foreground = Kind::make(Image<std::uint8_t>(kWidth, kHeight, 0));
    out.put("foreground", k > 0 && segmenter.mark_foreground(Kind::in(depth), Kind::out(foreground)));
    put_image(out, "foreground", Kind::in(foreground));
    const auto located = segmenter.locate(Kind::in(gray), Kind::in(depth), T_c_w, Kind::in(none));
    out.put("locate", located.T_c_w.template cast<double>().log());
    const auto& motion = segmenter.segment(Kind::in(gray), Kind::in(depth), static_cast<double>(k) / 30,
                                           T_c_w, Kind::in(none));
    out.put("ok", motion.ok());
    out.put("tracked", motion.tracked);
    out.put("seeds", motion.seeds);
    put_image(out, "mask", motion.mask);
    put_image(out, "verified", motion.verified);
    const auto mask = Kind::make(motion.mask);
    segmenter.remember(T_c_w, Kind::in(mask));
    segmenter.follow(SE3<S>());
    if (k + 1 < sequence.gray.size()) continue;
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) {
        there += sequence.moving[k](u, v) != 0 ? 1 : 0;
        found += sequence.moving[k](u, v) != 0 && motion.mask(u, v) != 0 ? 1 : 0;
      }
    }
  }
  segmenter.reset();
  out.put("clear", segmenter.has_reference() ? 1 : 0);
  found_share = static_cast<double>(found) / there;
  return out;
}

/// Weights of exact matches, every sixth of which moved.
template <class Kind, class Camera>
[[nodiscard]] Record<double> weight_results() {
  using S = typename Camera::ScalarType;
  using Vector2 = Eigen::Matrix<S, 2, 1>;
  static const BoardSequence<Camera> sequence;
  const auto camera = conformance_camera<Camera>();
  const SE3<S> T = (sequence.T_w_c[2].inverse() * sequence.T_w_c[0]).template cast<S>();
  std::vector<KeypointMatch<S>> matches;
  for (int v = 20; v < 100; v += 8) {
    for (int u = 90; u < 150; u += 8) {
      const auto match =
          keypoint_match(camera, Vector2(S(u), S(v)), S(sequence.depth[0](u, v)), Vector2(S(0), S(0)));
      if (!match) continue;
      matches.push_back(*match);
      const auto x_m = camera.project(T * match->p_ref);
      REQUIRE(x_m.has_value());
      matches.back().x_m = *x_m + (matches.size() % 6 == 0 ? Vector2(S(7), S(0)) : Vector2(S(0), S(0)));
    }
  }
  const auto before = Kind::make(sequence.gray[0]), now = Kind::make(sequence.gray[2]);
  const auto depth = Kind::make(sequence.depth[2]);
  StaticWeightsWorkspace<S> workspace;
  Record<double> out;
  const auto put = [&](const StaticWeightsResult<S>& result) {
    REQUIRE(result.ok());
    for (std::size_t i = 0; i < matches.size(); ++i)
      out.put("dynamic", (result.dynamic[i] != 0 || result.mismatch[i] != 0) == ((i + 1) % 6 == 0));
  };
  using Matches = std::span<const KeypointMatch<S>>;
  for (const auto& options : {StaticWeightsOptions<S>{}, StaticWeightsOptions<S>::paper()})
    put(static_weights(camera, Matches(matches), Kind::in(before), Kind::in(now), Kind::in(depth), T, options,
                       workspace));
  put(static_weights(camera, Matches(matches), Kind::in(before), Kind::in(now), Kind::in(depth), T));
  LocateWorkspace<S> locating;
  const auto located = locate_reference(camera, Matches(matches), SE3<S>(), Kind::in(depth), SE3<S>(),
                                        LocateOptions<S>{}, locating);
  out.put("locate_reference", located.ok() && (located.T_c_w * T.inverse()).log().norm() < S(0.01));
  PoseCheck<S> check;
  const auto checked = check.check(camera, Matches(matches), SE3<S>(), Kind::in(depth), T, LocateOptions<S>{}, {});
  out.put("pose_check", checked.supported ? 1 : 0);
  return out;
}

/// The belief of motion and the paper's regions over the sequence, each by itself, and how much of the board they find.
template <class Kind, class Camera>
[[nodiscard]] Record<double> belief_results(int& by_belief, int& by_regions, int& cells) {
  using S = typename Camera::ScalarType;
  using Vector2 = Eigen::Matrix<S, 2, 1>;
  static const BoardSequence<Camera> sequence;
  const DepthGrid grid(conformance_camera<Camera>(), kWidth, kHeight, {});
  MotionBelief<S> belief;
  MotionEvidence nothing;
  nothing.clear(grid.width(), grid.height(), 0, 1);
  Image<float> depth;
  Image<std::uint8_t> smooth, mask(grid.width(), grid.height(), 0);
  Record<double> out;
  const std::size_t last = sequence.gray.size() - 1;
  for (std::size_t k = 0; k <= last; ++k) {
    const auto image = Kind::make(sequence.depth[k]);
    grid.reduce(Kind::in(image), depth, smooth);
    const SE3<S> T_c_w = sequence.T_w_c[k].inverse().template cast<S>();
    const double t = static_cast<double>(k) / 30;
    belief.update(grid, depth, smooth, t, T_c_w, {}, std::span<const JudgedMatch<S>>(), mask);
    put_image(out, "belief", mask);
    const auto all = Kind::make(Image<std::uint8_t>(kWidth, kHeight, 255));
    belief.remember(grid, depth, t, T_c_w, Kind::in(all));
  }
  std::vector<JudgedMatch<S>> matches;
  const auto& moving = sequence.moving[last];
  for (int v = 4; v < kHeight - 4; v += 3) {
    for (int u = 4; u < kWidth - 4; u += 3) {
      const Vector2 x(static_cast<S>(u), static_cast<S>(v));
      const bool moves = moving(u, v) != 0;
      matches.push_back({x, x, moves ? S(0) : S(1), moves});
    }
  }
  Image<std::uint8_t> regions(grid.width(), grid.height(), 0);
  KeypointRegions<S> paper;
  (void)paper.find(std::span<const JudgedMatch<S>>(matches), grid, depth, {}, {}, {}, regions);
  put_image(out, "regions", regions);
  by_belief = by_regions = cells = 0;
  for (std::size_t c = 0; c < grid.cells(); ++c) {
    const RecordedPixel p = grid.pixel_of(c);
    const bool moves = p.u >= 0 && moving(p.u, p.v) != 0;
    cells += moves ? 1 : 0;
    by_belief += mask.data()[c] == 0 ? 0 : moves ? 1 : -1;
    by_regions += regions.data()[c] == 0 ? 0 : moves ? 1 : -1;
  }
  return out;
}

}  // namespace dynslam::test
