// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/concepts/image.hpp"
#include "dynslam/dynamics/depth_grid.hpp"
#include "dynslam/dynamics/free_space.hpp"
#include "dynslam/dynamics/free_space_verdicts.hpp"
#include "dynslam/dynamics/locate_reference.hpp"
#include "dynslam/dynamics/motion.hpp"
#include "dynslam/dynamics/motion_segmenter_options.hpp"
#include "dynslam/dynamics/moved_outlines.hpp"
#include "dynslam/dynamics/moves_as_one.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/image/image.hpp"
#include "dynslam/segment/keypoint_territories.hpp"
#include "dynslam/segment/mask_completion.hpp"

namespace dynslam {

/// Keypoints, and how many of them are at rest.
struct KeypointCount {
  int all = 0, at_rest = 0;

  void add(bool rests) {
    ++all;
    at_rest += rests ? 1 : 0;
  }
};

/// What the judged keypoints of a frame say of the cells around them and of the bodies that they stand on.
/// Memory is kept between frames.
template <std::floating_point S>
class KeypointBodies {
 public:
  /// Puts the keypoints into the grid, and starts the growing where many that are close together move.
  /// @param judged  index of each of `matches` in what was matched
  void place(std::span<const JudgedMatch<S>> matches, std::span<const std::size_t> judged,
             const DepthGrid& grid, const Image<float>& depth, const KeypointSeedOptions& options,
             const FreeSpaceMargins<float>& margins, FreeSpaceVerdicts& verdicts) {
    const S radius = S(options.radius * grid.image_width());
    const int rim = static_cast<int>(std::lround(options.rim * grid.width()));
    const int w = grid.width(), h = grid.height();
    bodies_ = 0;
    sites_.clear();
    site_match_.clear();
    for (std::size_t k = 0; k < matches.size(); ++k) {
      const JudgedMatch<S>& m = matches[k];
      const int c = grid.cell_at(static_cast<float>(m.x_m.x()), static_cast<float>(m.x_m.y()));
      if (c < 0) continue;
      const int i = c % w, j = c / w;
      int near = 0, near_static = 0;
      if (m.dynamic) {
        for (const JudgedMatch<S>& other : matches) {
          if ((other.x_m - m.x_m).cwiseAbs().maxCoeff() > radius) continue;
          ++(other.dynamic ? near : near_static);
        }
        if (near < near_static || beside_nearer(depth, i, j, rim, margins)) continue;
      }
      sites_.push_back({i, j, m.dynamic});
      site_match_.push_back(judged[k]);
      if (!m.dynamic || near < options.support) continue;
      for (int y = std::max(0, j - 1); y <= std::min(h - 1, j + 1); ++y) {
        for (int x = std::max(0, i - 1); x <= std::min(w - 1, i + 1); ++x) verdicts.take_for_moving(x, y);
      }
    }
  }

  /// Lets keypoints that move as one body speak for the surface that they lie on.
  template <DifferentiableCameraOf<S> Camera, DepthImage D>
  void find(const Camera& camera, std::span<const KeypointMatch<S>> matches, const SE3<S>& T_ref_w,
            const D& image, const SE3<S>& T_c_w, const Image<float>& depth,
            const MotionSegmenterOptions<S>& options, LocateWorkspace<S>& locating,
            FreeSpaceVerdicts& verdicts) {
    const KeypointSeedOptions& o = options.keypoint_seeds;
    const TerritoryOptions territory{static_cast<int>(std::lround(o.territory * depth.width())), o.body};
    const int parts = keypoint_territories(depth, std::span<const VerdictSite>(sites_), options.growing.step,
                                           territory, parts_, territories_);
    for (int part = 1; part <= parts; ++part) {
      if (territories_.keypoints[static_cast<std::size_t>(part)] < o.body) continue;
      body_.clear();
      for (std::size_t k = 0; k < sites_.size(); ++k) {
        if (sites_[k].moving && parts_(sites_[k].u, sites_[k].v) == part)
          body_.push_back(matches[site_match_[k]]);
      }
      if (!moves_as_one(camera, std::span<const KeypointMatch<S>>(body_), T_ref_w, image, T_c_w,
                        S(o.agreeing), options.locating, locating))
        continue;
      if (bodies_++ == 0) {
        votes_.resize(depth.width(), depth.height());
        votes_.fill(0);
        for (const VerdictSite& s : sites_) {
          if (!s.moving) votes_(s.u, s.v) = kForRest;
        }
      }
      for (const VerdictSite& s : sites_) {
        if (s.moving && parts_(s.u, s.v) == part) votes_(s.u, s.v) = kForBody;
      }
      for (int v = 0; v < depth.height(); ++v) {
        for (int u = 0; u < depth.width(); ++u) {
          if (parts_(u, v) == part) verdicts.doubt(u, v);
        }
      }
    }
  }

  /// Where a body's keypoints stand on a surface, and hardly one at rest, all of the surface is the body. As
  /// far as it slides in its own plane the depth takes it for verified, which it is not.
  template <OutputLabelImage Mask>
  void complete(const Image<float>& depth, const KeypointSeedOptions& o, const MaskGrowingOptions& growing,
                Mask&& mask, RegionGrowingWorkspace& ws, FreeSpaceVerdicts& verdicts) {
    if (bodies_ == 0) return;
    const auto share = [&](std::span<const PixelRun> runs) {
      int body = 0, rest = 0;
      for (const PixelRun& run : runs) {
        for (int u = run.begin; u < run.end; ++u) {
          body += votes_(u, run.v) == kForBody ? 1 : 0;
          rest += votes_(u, run.v) == kForRest ? 1 : 0;
        }
      }
      return body >= o.body && body >= o.outvoting * rest ? o.body_share : 2.0;
    };
    before_.resize(depth.width(), depth.height());
    for_each_cell([&](int u, int v) { before_(u, v) = mask(u, v) != 0 ? 1 : 0; });
    if (complete_surfaces(depth, mask, growing.step, share, growing.max_fraction, ws) == 0) return;
    for_each_cell([&](int u, int v) {
      if (mask(u, v) == 0) return;
      verdicts.verified(u, v) = 0;
      if (before_(u, v) == 0) verdicts.age(u, v) = 0;  // its keypoints are evidence of now
    });
  }

  /// Looks which keypoints are where they should be if they rest: what is judged by the scale of all
  /// residuals may rest as well where most of them move.
  template <DifferentiableCameraOf<S> Camera, DepthImage D>
  void find_rest(const Camera& camera, std::span<const KeypointMatch<S>> matches, const SE3<S>& T_ref_w,
                 const D& image, const SE3<S>& T_c_w, const LocateOptions<S>& options) {
    const SE3<S> T_w_ref = T_ref_w.inverse();
    rest_.clear();
    for (const std::size_t match : site_match_) {
      const auto o = reference_observation(matches[match], T_w_ref, image, options);
      rest_.push_back(observation_chi2(camera, T_c_w, o) < options.consensus.truncation ? 1 : 0);
    }
  }
  /// Counts the keypoints by surface, and how many of them find_rest() found at rest.
  /// @param surface  of each cell, counted from 1 to `surfaces`; 0: none
  /// @return of each; all keypoints together, on a surface or not, come first
  [[nodiscard]] std::span<const KeypointCount> count(const Image<int>& surface, std::size_t surfaces) {
    counts_.assign(surfaces + 1, {});
    for (std::size_t k = 0; k < sites_.size(); ++k) {
      const auto on = static_cast<std::size_t>(surface(sites_[k].u, sites_[k].v));
      if (on != 0) counts_[on].add(rest_[k] != 0);
      counts_[0].add(rest_[k] != 0);
    }
    return counts_;
  }

 private:
  template <class F>
  void for_each_cell(const F& f) const {
    for (int v = 0; v < before_.height(); ++v) {
      for (int u = 0; u < before_.width(); ++u) f(u, v);
    }
  }

  std::vector<VerdictSite> sites_;
  std::vector<std::size_t> site_match_;  // of sites_
  std::vector<std::uint8_t> rest_;       // likewise
  std::vector<KeypointCount> counts_;
  std::vector<KeypointMatch<S>> body_;
  int bodies_ = 0;    // parts that move as one
  Image<int> parts_;  // of the cells, by body
  TerritoryWorkspace territories_;
  enum Vote : std::uint8_t { kForBody = 1, kForRest = 2 };
  Image<std::uint8_t> votes_;   // of keypoints, by cell
  Image<std::uint8_t> before_;  // cells on the mask that complete() got
};

/// Whether a surface is a mover by its keypoints: it stands before the rest of the view, hardly one of them
/// rests, and most of the others do. Unlike what is judged by the scale of all residuals this holds where
/// most keypoints of the view are a mover's.
[[nodiscard]] inline bool keypoints_moved(const SurfaceOutline& s, const KeypointCount& on_it,
                                          const KeypointCount& all, const MovedOutlineOptions& options) {
  if (options.keypoints == 0 || on_it.all < options.keypoints ||
      on_it.all < options.keypoint_share * all.all || !s.in_foreground(options))
    return false;
  const KeypointCount others{all.all - on_it.all, all.at_rest - on_it.at_rest};
  return on_it.at_rest <= options.resting * on_it.all && others.all >= options.keypoints &&
         2 * others.at_rest >= others.all;
}

}  // namespace dynslam
