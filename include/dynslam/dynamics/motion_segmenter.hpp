// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "dynslam/concepts/camera.hpp"
#include "dynslam/concepts/image.hpp"
#include "dynslam/dynamics/depth_grid.hpp"
#include "dynslam/dynamics/keypoint_regions.hpp"
#include "dynslam/dynamics/locate_reference.hpp"
#include "dynslam/dynamics/motion_belief.hpp"
#include "dynslam/dynamics/motion_method.hpp"
#include "dynslam/dynamics/motion_result.hpp"
#include "dynslam/dynamics/motion_segmenter_options.hpp"
#include "dynslam/dynamics/pose_check.hpp"
#include "dynslam/dynamics/reference_keyframe.hpp"
#include "dynslam/dynamics/static_weights.hpp"
#include "dynslam/features/corners.hpp"
#include "dynslam/geometry/rolling_camera.hpp"
#include "dynslam/geometry/rolling_shutter.hpp"
#include "dynslam/geometry/se3.hpp"
#include "dynslam/image/depth.hpp"
#include "dynslam/image/image.hpp"
#include "dynslam/image/image_view.hpp"
#include "dynslam/image/pyramid.hpp"
#include "dynslam/segment/mask_completion.hpp"
#include "dynslam/segment/mask_growing.hpp"
#include "dynslam/segment/mask_upsampling.hpp"

namespace dynslam {

/// Finds what moves in RGB-D images without knowing what it is, inside any SLAM system (paper, steps 5 to 9):
///
///     const auto& motion = segmenter.segment(gray, depth, t, T_c_w);  // with the pose as known so far
///     ... drop features on motion.mask, optimise the pose ...
///     segmenter.remember(T_c_w, motion.mask);                         // evidence for later frames
///
/// Images are of any type that is ImageLike, of the camera's recorded pixels; depth is in metres (invalid =
/// NaN or <= 0) and registered to the grey image. Times are in seconds, of any clock that only goes forward;
/// frames may come at any rate, or at none: what is old is told by the times alone. Memory is kept between
/// frames. Not thread-safe.
template <std::floating_point S, DifferentiableCamera Camera>
  requires std::same_as<typename Camera::ScalarType, S>
class MotionSegmenter {
 public:
  using Options = MotionSegmenterOptions<S>;
  using Vector2 = Eigen::Matrix<S, 2, 1>;
  using NoPrior = ImageView<const std::uint8_t>;

  explicit MotionSegmenter(const Camera& camera, const Options& options = {})
      : camera_(camera), options_(options), belief_(options.belief) {}

  [[nodiscard]] const Options& options() const { return options_; }

  /// The camera's motion from the next frame's grey image to its depth image, where they are not taken at
  /// once: in a fast turn, 20 ms make the whole room stand elsewhere. Nullopt: at once, or it is unknown.
  void set_depth_motion(const std::optional<SE3<S>>& T_depth_c) { T_depth_c_ = T_depth_c; }

  /// How the camera moves while the next frame's rows are read, colour and depth; poses are the middle row's.
  void set_rolling_shutter(const RollingShutter<S>& shutter) { shutter_ = shutter; }

  /// Finds what moves in a frame with the given initial pose. The first call fixes the size of the images. A
  /// frame may be segmented again, with a better pose, until it is remembered.
  /// @param t         when the frame was taken, later than the frame last remembered [s]
  /// @param prior     a-priori mask of what may move, 0 x 0 without one: never enters scales or F
  /// @param on_stage  called with each MotionStage when it is done (to take times)
  /// @return valid until the next call
  template <ImageLike G, DepthImage D, LabelImage M = NoPrior, class OnStage = IgnoreStages>
  const MotionResult<S>& segment(const G& gray, const D& depth, double t, const SE3<S>& T_c_w,
                                 const M& prior = {}, OnStage&& on_stage = {});

  /// The pose of a frame that is to be segmented next, for hosts whose own pose is not yet to be trusted:
  /// what moves spoils it, and a spoilt pose makes the room move. Found from the reference keypoints alone,
  /// see locate_reference(); the first frame is where it is predicted.
  /// @param T_c_w_predicted  by the motion so far, in the world of the poses given to `remember`
  /// @param prior            a-priori mask of what may move: what is on it does not count; 0 x 0 without one
  template <ImageLike G, DepthImage D, LabelImage M = NoPrior>
  PoseConsensusResult<S> locate(const G& gray, const D& depth, const SE3<S>& T_c_w_predicted,
                                const M& prior = {});

  /// Marks what stands before the rest of the view (in_foreground() of its surfaces) with 255, before the
  /// frame is segmented. @return false, with nothing marked: an image of another size than the first one
  template <DepthImage D, OutputLabelImage Mask>
  bool mark_foreground(const D& depth, Mask&& out) {
    if (!accept_size(depth, depth, NoPrior{}) || out.width() != depth.width() ||
        out.height() != depth.height())
      return false;
    grid_.reduce(depth, depth_, smooth_);
    belief_.mark_foreground(grid_, depth_, cell_mask_);
    upsample_mask(cell_mask_.view(), depth_, depth, grid_, out, zone_);
    return true;
  }

  /// What the last call of `segment` found.
  [[nodiscard]] const MotionResult<S>& motion() const { return motion_; }

  /// Keeps the frame last segmented, with its final pose and mask, as evidence for later ones. Call it once
  /// per segmented frame; after a frame that was refused, or a second time, it does nothing.
  /// @param mask  what was taken for dynamic in the depth image in the end, of its size; 0 x 0: nothing
  template <LabelImage M>
  void remember(const SE3<S>& T_c_w, const M& mask);

  /// Forgets all frames, as where the clock was set back or another sequence begins.
  void reset() {
    belief_.clear();
    pose_check_.clear();
    reference_ = {};
    last_t_.reset();
    segmented_ = false;
  }

  /// Moves what is remembered with a correction of the map (after a loop or an adjustment):
  /// new T_c_w = old T_c_w D.
  void follow(const SE3<S>& D) {
    belief_.follow(D);
    pose_check_.follow(D);
    reference_.place(reference_.T_c_w() * D);
  }

  /// Makes the frame last segmented the reference keyframe, with keypoints of the host's own. From then on
  /// the host chooses them.
  void set_reference(std::span<const ReferenceKeypoint<S>> keypoints, const SE3<S>& T_c_w) {
    options_.own_reference.use = false;
    reference_.set(rolling(), pyramid_, keypoints, T_c_w, options_.reference);
  }
  [[nodiscard]] bool has_reference() const { return !reference_.empty(); }
  /// Whether too little of the reference keyframe was in view or found in the frame last segmented: a new one
  /// tells more, without delay.
  [[nodiscard]] bool reference_stale() const {
    const auto size = static_cast<double>(reference_.size());
    return static_cast<double>(motion_.tracked) < options_.reference.min_found * size ||
           static_cast<double>(reference_.in_view()) < options_.reference.min_in_view * size;
  }
  /// Puts the reference keyframe where the host's map has it by now.
  void place_reference(const SE3<S>& T_c_w) { reference_.place(T_c_w); }

  /// Log-odds that what is seen moves, in the cells of the frame last segmented; the mask is where they are
  /// above 0 (MotionMethod::full).
  [[nodiscard]] const Image<float>& belief() const { return belief_.evidence().belief; }
  /// The cells, and where pixels have theirs. Of the first frame's size; empty before it.
  [[nodiscard]] const DepthGrid& grid() const { return grid_; }

  /// Whether the surface at a pixel of the frame last segmented was seen in the same place long before.
  [[nodiscard]] bool verified_static(float u, float v) const { return at_pixel(motion_.verified, u, v) != 0; }

 private:
  /// What an image of cells has at a pixel; 0 where it has nothing.
  template <class T>
  [[nodiscard]] T at_pixel(const Image<T>& cells, float u, float v) const {
    if (cells.width() == 0) return T(0);
    const int c = grid_.cell_at(u, v);
    return c >= 0 ? cells.data()[c] : T(0);
  }

  template <class G, class D, class M>
  [[nodiscard]] bool accept_size(const G& gray, const D& depth, const M& prior) {
    const int w = gray.width(), h = gray.height();
    if (w != depth.width() || h != depth.height() || w <= 0 || h <= 0) return false;
    if (prior.width() != 0 && (prior.width() != w || prior.height() != h)) return false;
    if (grid_.cells() == 0) {
      grid_ = DepthGrid(camera_, w, h, options_.grid);
      cell_mask_.resize(grid_.width(), grid_.height());
      motion_.mask.resize(w, h);
      found_.resize(w, h);
    }
    return w == grid_.image_width() && h == grid_.image_height();
  }

  /// Gives no mask. Where that has lasted for long, what is remembered is of no use any more.
  const MotionResult<S>& refuse(MotionStatus why) {
    if (last_t_ && t_ - *last_t_ >= options_.own_reference.max_age) reset();
    return motion_.refuse(why);
  }

  [[nodiscard]] bool covers_view() const {
    const auto valid = std::count_if(depth_.data(), depth_.data() + grid_.cells(),
                                     [](float z) { return is_valid_depth(z); });
    return static_cast<double>(motion_.seeds) > options_.pose_check.most * static_cast<double>(valid);
  }

  /// Settles the pose that the frame's evidence rests on.
  template <class D, class M>
  void check_pose(const D& depth, const SE3<S>& T_c_w, const M& prior) {
    checked_ = {T_c_w};
    motion_.own_pose = false;
    if (!options_.pose_check.use || matches_.size() < options_.weights.min_matches) return;
    checked_ = pose_check_.check(rolling(), std::span<const KeypointMatch<S>>(matches_), reference_.T_c_w(),
                                 depth, T_c_w, options_.locating, options_.pose_check);
    if (!checked_.supported) {
      refuse(MotionStatus::pose_unsupported);
    } else if (!checked_.host) {
      motion_.own_pose = true;
      motion_.T_c_w = checked_.T_c_w;
      reference_.track(rolling(), pyramid_, checked_.T_c_w, prior, options_.reference, matches_);
    }
  }

  template <class D>
  void judge_matches(const D& depth, const SE3<S>& T_c_w) {
    motion_.tracked = static_cast<int>(matches_.size());
    motion_.mismatches = motion_.dynamic_matches = 0;
    motion_.epipolar_used = false;
    motion_.scales = {};
    if (matches_.empty()) return;
    const auto& result = static_weights(rolling(), std::span<const KeypointMatch<S>>(matches_),
                                        reference_.gray(), pyramid_.image(0), depth,
                                        T_c_w * reference_.T_c_w().inverse(), options_.weights, weights_);
    motion_.mismatches = result.mismatches;
    motion_.epipolar_used = result.epipolar == EpipolarVerdict::applied;
    if (!result.ok()) return;
    motion_.dynamic_matches = result.dynamic_matches;
    motion_.scales = result.scales;
    for (std::size_t k = 0; k < matches_.size(); ++k) {
      if (result.invalid[k] != 0) continue;
      // A match whose patches look alike and that is off its epipolar curve moves as often as it is wrong.
      // The paper has no other sign of what moves across the curves; the belief has, and leaves it.
      const bool mismatch = result.mismatch[k] != 0;
      if (mismatch && options_.method == MotionMethod::full) continue;
      const bool moves = mismatch || result.dynamic[k] != 0;
      reference_.mark(k, moves);
      motion_.matches.push_back({matches_[k].x, matches_[k].x_m, result.weight[k], moves});
    }
  }

  [[nodiscard]] RollingCamera<Camera> rolling() const { return {camera_, shutter_}; }
  [[nodiscard]] SE3<S> depth_pose(const SE3<S>& T_c_w) const {
    return T_depth_c_ ? *T_depth_c_ * T_c_w : T_c_w;
  }

  void take_reference(const SE3<S>& T_c_w) {
    const int level = std::min(1, pyramid_.size() - 1);
    find_corners(pyramid_.image(level),
                 options_.own_reference.corners_per_keypoint * options_.reference.points,
                 options_.own_reference.corners, corner_workspace_, corners_);
    keypoints_.clear();
    for (const Eigen::Vector2i& corner : corners_) {
      const Vector2 x = to_base<S>(pyramid_, corner.template cast<S>().eval(), level);
      const int c = grid_.cell_at(static_cast<float>(x.x()), static_cast<float>(x.y()));
      // The reduced depth of a cell on one surface: at an edge the corner's own depth is a guess.
      if (c < 0 || smooth_.data()[c] == 0) continue;
      keypoints_.push_back(
          {x, static_cast<S>(depth_.data()[c]), S(1 << level), belief_.evidence().belief.data()[c] > 0});
    }
    reference_.set(rolling(), pyramid_, std::span<const ReferenceKeypoint<S>>(keypoints_), T_c_w,
                   options_.reference);
    reference_t_ = t_;
  }

  Camera camera_;
  Options options_;
  DepthGrid grid_;
  HalvingPyramid<std::uint8_t> pyramid_;  // of the frame last segmented
  std::optional<SE3<S>> T_depth_c_;       // of the next frame: where depth is taken
  RollingShutter<S> shutter_;             // and how the camera moves meanwhile
  double t_ = 0;                          // of the frame last segmented [s]
  bool segmented_ = false;                // and not yet remembered
  std::optional<double> last_t_;          // of the frame last remembered [s]
  ReferenceKeyframe<S> reference_;
  double reference_t_ = 0;  // when its frame was taken [s]
  std::vector<KeypointMatch<S>> matches_;
  LocateWorkspace<S> locating_;
  StaticWeightsWorkspace<S> weights_;
  PoseCheck<S> pose_check_;
  typename PoseCheck<S>::Result checked_;  // the pose of the frame last segmented
  MotionBelief<S> belief_;
  Image<float> depth_;                             // reduced
  Image<std::uint8_t> smooth_, cell_mask_, zone_;  // of the cells
  KeypointRegions<S> regions_;
  UnmeasuredWorkspace unmeasured_;
  MaskWorkspace morphology_;
  Image<std::uint8_t> found_;  // the mask without its margin
  CornerWorkspace corner_workspace_;
  std::vector<Eigen::Vector2i> corners_;
  std::vector<ReferenceKeypoint<S>> keypoints_;
  MotionResult<S> motion_;
};

// Defined here, and so not inline: an explicit instantiation elsewhere (motion_segmenter_instances.hpp) keeps
// them out of a program's own files.

template <std::floating_point S, DifferentiableCamera Camera>
  requires std::same_as<typename Camera::ScalarType, S>
template <ImageLike G, DepthImage D, LabelImage M, class OnStage>
const MotionResult<S>& MotionSegmenter<S, Camera>::segment(const G& gray, const D& depth, double t,
                                                           const SE3<S>& T_c_w, const M& prior,
                                                           OnStage&& on_stage) {
  segmented_ = false;
  motion_.T_c_w = T_c_w;
  if (!accept_size(gray, depth, prior)) return motion_.refuse(MotionStatus::size_mismatch);
  if (!std::isfinite(t) || (last_t_ && !(t > *last_t_))) return motion_.refuse(MotionStatus::time_not_later);
  motion_.status = MotionStatus::ok;
  motion_.matches.clear();
  t_ = t;
  pyramid_.build(gray, options_.reference.levels);
  reference_.track(rolling(), pyramid_, T_c_w, prior, options_.reference, matches_);
  check_pose(depth, T_c_w, prior);
  on_stage(MotionStage::matching);
  if (!motion_.ok()) return motion_;
  judge_matches(depth, checked_.T_c_w);
  on_stage(MotionStage::residuals);
  grid_.reduce(depth, depth_, smooth_);
  if (options_.method == MotionMethod::full) {
    motion_.seeds = belief_.update(grid_, depth_, smooth_, t, depth_pose(checked_.T_c_w), shutter_,
                                   motion_.matches, cell_mask_);
  } else {
    belief_.forget_evidence(grid_);
    const MaskGrowingResult grown = regions_.find(motion_.matches, grid_, depth_, options_.regions,
                                                  options_.growing, options_.belief.supports, cell_mask_);
    motion_.seeds = grown.seeds;
    motion_.regions_leaked = grown.regions_leaked;
  }
  motion_.verified = belief_.evidence().rested;
  on_stage(MotionStage::free_space);
  if (options_.pose_check.use && covers_view()) return refuse(MotionStatus::covers_view);
  upsample_mask(cell_mask_.view(), depth_, depth, grid_, motion_.mask.view(), zone_);
  if (options_.method == MotionMethod::full && motion_.seeds > 0)
    complete_unmeasured(pyramid_.image(0), depth, motion_.mask.view(), options_.unmeasured, unmeasured_);
  const int margin = static_cast<int>(std::lround(options_.margin * depth.width()));
  if (options_.method == MotionMethod::full && motion_.seeds > 0 && margin > 0) {
    std::swap(motion_.mask, found_);
    dilate(found_.view(), motion_.mask.view(), margin, morphology_);
  }
  segmented_ = true;
  on_stage(MotionStage::growing);
  return motion_;
}

template <std::floating_point S, DifferentiableCamera Camera>
  requires std::same_as<typename Camera::ScalarType, S>
template <ImageLike G, DepthImage D, LabelImage M>
PoseConsensusResult<S> MotionSegmenter<S, Camera>::locate(const G& gray, const D& depth,
                                                          const SE3<S>& T_c_w_predicted, const M& prior) {
  PoseConsensusResult<S> located;
  located.T_c_w = T_c_w_predicted;
  if (!accept_size(gray, depth, prior)) {
    located.status = PoseConsensusStatus::bad_input;
    return located;
  }
  pyramid_.build(gray, options_.reference.levels);
  for (int round = 0; round < options_.locating.rounds; ++round) {
    reference_.track(rolling(), pyramid_, located.T_c_w, prior, options_.reference, matches_);
    const PoseConsensusResult<S> next =
        locate_reference(rolling(), std::span<const KeypointMatch<S>>(matches_), reference_.T_c_w(), depth,
                         located.T_c_w, options_.locating, locating_);
    if (!next.ok() || next.inliers <= located.inliers) break;
    located = next;
  }
  return located;
}

template <std::floating_point S, DifferentiableCamera Camera>
  requires std::same_as<typename Camera::ScalarType, S>
template <LabelImage M>
void MotionSegmenter<S, Camera>::remember(const SE3<S>& T_c_w, const M& mask) {
  if (!std::exchange(segmented_, false)) return;
  last_t_ = t_;
  const SE3<S> T = checked_.host ? T_c_w : checked_.T_c_w;
  if (options_.method == MotionMethod::full) belief_.remember(grid_, depth_, t_, depth_pose(T), mask);
  const bool wanted = reference_.empty() || t_ - reference_t_ >= options_.own_reference.max_age ||
                      reference_.resting_found() < options_.own_reference.min_resting_found ||
                      reference_stale();
  if (options_.own_reference.use && wanted) take_reference(T);
}

}  // namespace dynslam

#include "dynslam/dynamics/motion_segmenter_instances.hpp"

#include "dynslam/pop_macros.hpp"
