// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "dynslam/optim/pose.hpp"
#include "dynslam/optim/pose_consensus.hpp"
#include "dynslam/runtime/io/camera.hpp"
#include "dynslam/runtime/io/mask_reader.hpp"
#include "dynslam/runtime/io/tum_reader.hpp"
#include "dynslam/runtime/slam/feature_extractor.hpp"
#include "dynslam/runtime/slam/frame.hpp"
#include "dynslam/runtime/slam/geometric_segmenter.hpp"
#include "dynslam/runtime/slam/local_bundle.hpp"
#include "dynslam/runtime/slam/local_map.hpp"
#include "dynslam/runtime/slam/loop_closer.hpp"
#include "dynslam/runtime/slam/place_index.hpp"
#include "dynslam/runtime/slam/place_verifier.hpp"

namespace dynslam::runtime {

/// Which masks remove features (the rows of the paper's Table 4).
enum class DynamicsMode { none, semantic, geometric, both };

[[nodiscard]] std::optional<DynamicsMode> parse_dynamics(std::string_view name);
[[nodiscard]] std::string_view to_string(DynamicsMode mode);
[[nodiscard]] constexpr bool uses_semantic(DynamicsMode m) {
  return m == DynamicsMode::semantic || m == DynamicsMode::both;
}
[[nodiscard]] constexpr bool uses_geometry(DynamicsMode m) {
  return m == DynamicsMode::geometric || m == DynamicsMode::both;
}

struct TrackerOptions {
  DynamicsMode dynamics = DynamicsMode::both;
  FeatureOptions features;
  GeometryOptions geometry;
  double nu = 5.0;               ///< t-distribution of the pose optimisation
  double patch_sigma = 0.5;      ///< pixels of its level: accuracy of a match by patch; a corner has 1
  double min_pixel_scale = 0.4;  ///< how much better than stated the pixel noise may turn out
  std::uint64_t seed = 1;        ///< of the consensus
  /// Sensor noise, and the time between colour and depth image.
  DepthNoise<double> depth_noise{0.004, 0.008};
  double max_point_depth =
      8.0;                    ///< farther depth makes no map points [m]; noise grows with z^2, weights follow
  int min_inliers = 25;       ///< fewer: the pose is not accepted
  int weak_inliers = 8;       ///< of the last frame's points: a start whose proof is the local map
  int coasting_frames = 3;    ///< lost for fewer: the motion that was is tried before the places
  double prior_share = 0.2;   ///< the predicted motion counts as this share of all matches
  double prior_speed = 0.9;   ///< standard deviation of the change of velocity between two frames [m/s]
  double prior_turn = 0.9;    ///< and of the angular velocity's [rad/s]
  double local_chi2 = 25;     ///< squared normalised error from which a match of the local map is dropped
  int local_keyframes = 12;   ///< neighbours whose points are searched
  int semantic_dilation = 9;  ///< pixels added around a-priori masks
  int feature_margin = 6;     ///< pixels around the fused mask in which features are not used
  double resting_share = 0.4;   ///< of a person seen in the same place long before: it is at rest
  int enough_known = 200;       ///< features on known static surfaces from which on others make no points
  double keyframe_ratio = 0.6;  ///< of the last keyframe's tracked points
  int keyframe_max_gap = 30;    ///< frames
  int keyframe_min_gap = 6;     ///< frames
  int keyframe_urgent = 100;    ///< inliers below which the gap does not matter
  double keyframe_translation = 0.15;  ///< metres
  double keyframe_rotation = 0.20;     ///< radians
  bool bundle = true;                  ///< adjust the newest keyframes and their points
  int bundle_delay = 4;                ///< frames after which the adjustment's result is waited for and used
  LocalBundleOptions local_bundle;
  bool close_loops = true;
  int loop_bundle_window = 60;  ///< keyframes adjusted after a loop
  int loop_bundle_delay = 12;   ///< frames after which that is waited for
  LoopOptions loops;
  PlaceOptions relocalisation;
  int relocalisation_candidates = 5;  ///< keyframes tried per lost frame
  double max_speed = 4;               ///< of a hand [m/s]: farther, a place that looks right is another one
  double max_turn = 8;                ///< [rad/s]
  double redundant_keyframe = 0.9;    ///< of its points seen by three others: a keyframe goes
  int spare_keyframes = 5;            ///< newest keyframes, which never go
  int reference_distance = 5;         ///< keyframes between the present one and the reference (paper, step 4)
};

/// Parts of a frame's work, in the order of the columns of timings.csv. `tracking` is the tracking thread's
/// whole time; `features` are extracted ahead on the decoding thread where the pipeline says so.
enum class Stage {
  features,
  initial_pose,
  local_map,
  lucas_kanade,
  residuals,
  free_space,
  growing,
  pose,
  keyframe,
  tracking
};
inline constexpr std::array<std::string_view, 10> kStageNames{
    "features",   "initial_pose", "local_map", "lucas_kanade", "residuals",
    "free_space", "growing",      "pose",      "keyframe",     "tracking"};
using StageTimes = std::array<double, kStageNames.size()>;  ///< milliseconds

enum class TrackingState { not_initialised, tracked, relocalised, lost };
[[nodiscard]] std::string_view to_string(TrackingState state);

struct TrackResult {
  TrackingState state = TrackingState::not_initialised;
  SE3<double> T_w_c;  ///< as known now; the final pose is T_c_reference's with the reference's last one
  int reference = 0;  ///< the newest keyframe
  SE3<double> T_c_reference;
  bool keyframe = false;
  std::optional<LoopClosing> loop;  ///< closed at this keyframe: T_w_c is corrected already
  bool mask_rejected = false;       ///< the mask left too few features and was not applied to the pose
  int matches = 0, inliers = 0;
  cv::Mat dynamic_mask;  ///< CV_8UC1, 255 = dynamic; always of image size
  GeometryStatistics geometry;
  StageTimes times{};
};

/// Frame-to-local-map RGB-D tracking with the paper's order of work per frame: initial pose from
/// points outside the a-priori mask, geometry against the reference keyframe, fused mask, second
/// optimisation on what is left.
class Tracker {
 public:
  Tracker(const CameraConfig& camera, const TrackerOptions& options);
  Tracker(const Tracker&) = delete;
  Tracker& operator=(const Tracker&) = delete;

  /// Tracks the next frame. `prior` is the a-priori (semantic) mask, if there is one. The caller may use its
  /// images again afterwards: what is kept of them is copied. Frames are counted here; `input.index` plays no
  /// part.
  /// @throws InputError, with nothing changed: images or masks that are not of the camera's size or of
  /// another type
  ///         than RgbdFrame and Masks say, or a time that does not come after the frame's before
  TrackResult track(const RgbdFrame& input, const std::optional<Masks>& prior);

  /// Goes on in an earlier map: the camera is lost until it finds itself there. Call it before track().
  void load(LocalMap map);

  /// Uses what is still being adjusted. Call it at the end, before poses are read from the map.
  void finish();

  [[nodiscard]] const LocalMap& map() const { return map_; }
  /// People at rest, whose features the next frame uses, CV_8UC1; empty where nobody is known to be.
  [[nodiscard]] const cv::Mat& resting() const { return resting_; }

 private:
  void extract(const RgbdFrame& input, Frame& frame);
  /// Where the camera will have been when the depth image was taken, by its present velocity.
  void predict_depth_motion(const RgbdFrame& input);
  /// Removes the features that were added for map points which the frame does not match after all.
  void drop_unmatched(Frame& frame) const;
  /// Takes instances that have not moved for long out of the mask: their points serve the pose, but
  /// the map, which goes by labels, never gets their surface.
  void give_back_resting(const Masks& prior, const cv::Mat& depth, const cv::Mat& moving, cv::Mat& dynamic);
  void flag_dynamic(Frame& frame, const cv::Mat& mask) const;
  bool initialise(Frame& frame, const RgbdFrame& input);
  int match_last(Frame& frame, const SE3<double>& T_c_w, float radius);
  /// Matches the local map's points, by their patches where these are found, by descriptor otherwise.
  int match_local(Frame& frame, const SE3<double>& T_c_w, const cv::Mat& depth);
  /// Finds a point by its patch, near the recorded pixel `start`.
  [[nodiscard]] bool align(const MapPoint& p, const SE3<double>& T_c_w, const Eigen::Vector2d& start,
                           PatchMatch& out) const;
  void move(Feature& f, const PatchMatch& match, const cv::Mat& depth) const;
  /// Moves matched features to where the patches of their points are.
  void refine_matches(Frame& frame, const SE3<double>& T_c_w, const cv::Mat& depth) const;
  /// Drops the matches (of observations_) whose squared normalised error is `bound` or more.
  void keep_consistent(Frame& frame, const SE3<double>& T_c_w, double bound);
  /// Puts a feature at a recorded pixel: ideal pixel and depth follow from it.
  void place(Feature& f, const Eigen::Vector2d& x, const cv::Mat& depth) const;
  [[nodiscard]] bool needs_patch(const MapPoint& p, const Frame& frame) const;
  void cut_patch(MapPoint& p, const Feature& f) const;
  /// Collects the frame's matches outside its dynamic flags into observations_.
  void gather(const Frame& frame);
  /// Pose from the frame's matches outside its dynamic flags; outliers lose their match.
  PoseResult<double> optimise(Frame& frame, const SE3<double>& start, bool drop_outliers);
  /// Fills weights_ with the surface that each of observations_ stands for.
  void weigh_by_surface(const SE3<double>& T_c_w);
  [[nodiscard]] bool reachable(const SE3<double>& T_c_w, double t) const;
  bool relocalise(Frame& frame, const cv::Mat& depth, SE3<double>& T_c_w);
  /// Waits for the bundle adjustment, if one runs, and uses it. @return the correction, see follow()
  SE3<double> settle();
  /// Moves what was placed relative to the newest keyframe: new T_c_w = old T_c_w D.
  void follow(const SE3<double>& D);
  [[nodiscard]] bool wants_keyframe(const Frame& frame, int inliers) const;
  std::optional<LoopClosing> insert_keyframe(Frame& frame, const RgbdFrame& input);
  [[nodiscard]] Eigen::Vector3d point_of(const Frame& frame, int feature) const;
  [[nodiscard]] bool find_best(const Frame& frame, const Descriptor& descriptor, float x, float y,
                               float radius, int octave_low, int octave_high, int max_distance, float ratio,
                               int& best, int& distance) const;

  CameraConfig camera_;
  TrackerOptions options_;
  FeatureExtractor extractor_;
  GeometricSegmenter geometry_;
  LocalMap map_;
  LocalBundle bundle_;
  PlaceIndex places_;
  PlaceVerifier verifier_;
  LoopCloser loops_;
  std::size_t bundle_due_ = 0;  // frame index
  Frame last_;
  SE3<double> velocity_;      // T_c_last
  SE3<double> T_depth_c_;     // from the camera at colour time to the camera at depth time
  bool depth_moved_ = false;  // the two differ
  bool initialised_ = false;
  int lost_frames_ = 0;
  std::size_t frames_ = 0;        // tracked or lost so far
  std::optional<double> last_t_;  // of the frame before [s]
  std::size_t corners_ = 0;       // features of the present frame that were extracted, not added for points
  int reference_id_ = 0;
  std::size_t last_keyframe_index_ = 0;
  int last_keyframe_tracked_ = 0;
  std::vector<cv::Point2f> undistort_lut_;         // per raw pixel: ideal pixel
  std::shared_ptr<const ImageFeatures> features_;  // of the present frame
  std::vector<std::pair<int, int>> places_found_;
  std::vector<int> candidates_, observation_feature_, match_distance_, holder_;
  std::vector<PoseObservation<double>> observations_;
  std::vector<double> weights_;  // of observations_ in the consensus
  std::vector<std::uint8_t> occupied_;
  cv::Mat resting_;  // people at rest, CV_8UC1
  PoseWorkspace<double> workspace_;
};
// A thread of its own adjusts the map through pointers to its members.
static_assert(!std::is_move_constructible_v<Tracker> && !std::is_move_assignable_v<Tracker>);

}  // namespace dynslam::runtime
