// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "dynslam/geometry/pose_curve.hpp"
#include "dynslam/map/local_matcher.hpp"
#include "dynslam/map/masked_pose.hpp"
#include "dynslam/map/matched_pose.hpp"
#include "dynslam/map/point_maker.hpp"
#include "dynslam/runtime/frame.hpp"
#include "dynslam/runtime/io/camera.hpp"
#include "dynslam/runtime/masks.hpp"
#include "dynslam/runtime/slam/feature_extractor.hpp"
#include "dynslam/runtime/slam/last_view.hpp"
#include "dynslam/runtime/slam/local_bundle.hpp"
#include "dynslam/runtime/slam/track_result.hpp"
#include "dynslam/runtime/slam/tracker_options.hpp"
#include "dynslam/runtime/slam/types.hpp"

namespace dynslam::runtime {

/// Frame-to-local-map RGB-D tracking with the paper's order of work per frame: initial pose from
/// points outside the a-priori mask, geometry against the reference keyframe, fused mask, second
/// optimisation on what is left.
class Tracker {
 public:
  Tracker(const CameraConfig& camera, const TrackerOptions& options);
  ~Tracker();
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

  /// Takes in another tracker's map, whose world T_w_other places in this one's. @return id of its first
  /// keyframe here
  int adopt(const LocalMap& other, const SE3<double>& T_w_other);

  /// Uses what is still being adjusted. Call it at the end, before poses are read from the map.
  void finish();

  /// Has readout() measured by the frames from now on.
  void measure_readout() { readout_.emplace(); }
  /// How much longer the rows take than the camera's readout_time says; empty where it is not measured.
  [[nodiscard]] const std::optional<ReadoutMeasurement<double>>& readout() const { return readout_; }

  [[nodiscard]] const LocalMap& map() const { return map_; }
  /// Bundle adjustments that were used so far.
  [[nodiscard]] std::size_t adjustments() const { return adjustments_; }
  /// What the geometry found in the frame last tracked; null where the mode does not ask it. After a frame
  /// that was lost it is an earlier one's.
  [[nodiscard]] const Motion<double>* motion() const {
    return uses_geometry(options_.dynamics) ? &geometry_.motion() : nullptr;
  }

 private:
  struct Present;  // the frame at hand
  struct Attempt;  // a pose of it, and what was matched for that
  struct Lost;     // a frame that has no pose yet

  // One frame, in the order of work.
  void extract(Present& now);
  void mask_a_priori(Present& now, const std::optional<Masks>& prior) const;
  static bool disbelieve_prior(Present& now, MaskVerdict why);
  void start_map(Present& now);
  bool locate(Present& now);
  void look_behind(Present& now);
  bool begin_again(const Present& now);
  /// Finds the pose from the last frame's points, and proves it on the local map's.
  bool locate_by_features(Present& now);
  bool try_initial_pose(Present& now, const SE3<double>& predicted, float radius);
  [[nodiscard]] Attempt attempt(const Present& now) const;
  void take_back(Present& now, const Attempt& earlier);
  /// Finds a pose by the last frame's grey values, as a start where its points do not tell. @return whether
  /// it did
  bool align_with_last(Present& now);
  /// Finds the pose from there. @return whether `wanted` points of the local map fit it
  bool locate_by_alignment(Present& now, int wanted);
  /// Tells the placer how the camera moves while the images are taken. @param T_c_last  since the last frame
  void set_motion(const Present& now, const SE3<double>& T_c_last);
  void place_again(Present& now);
  void place_features(Present& now) const;
  void look_for_turn(const Present& now, const Eigen::Vector3d& turn);
  void take_turn(Present& now, const Eigen::Vector3d& turn);
  void measure_rows(const Present& now);
  /// Matches the local map's points. @return whether `wanted` of them fit one pose
  bool prove_on_local_map(Present& now, int wanted);
  /// The same, again and again for as long as more points fit.
  bool settle_on_local_map(Present& now, int wanted);
  bool look_around(Present& now);
  bool locate_with_prior(Present& now);
  [[nodiscard]] bool leads_farther(const Attempt& rest, const Attempt& all, double times) const;
  void start_again(Present& now);
  [[nodiscard]] SE3<double> predicted_pose() const;
  [[nodiscard]] int old_matches(const Frame& frame) const;
  [[nodiscard]] double depth_of_matches(const Present& now) const;
  bool relocalise(Present& now);
  void find_movers(Present& now);
  void find_standing(Present& now);
  void pose_without_movers(Present& now);
  void doubt_points_on_movers(Present& now);
  void accept(Present& now);
  /// Finds the pose of the frame before once more, by how the camera moved at its time.
  void revise_last(Present& now);
  void revise_keyframe(int id);
  /// Keeps a frame that was lost, for recover().
  void remember_lost(Present& now);
  /// Goes once more through the loss that the frame at hand ends: the camera is known on both sides of it.
  void recover(Present& now);
  /// Looks for a frame that was lost on the local map. @param around  poses that are known near it
  void locate_again(Lost& lost, std::span<const TimedPose<double>> around);
  /// Makes the frame at hand a keyframe, or notes that one shows the same.
  void keep(Present& now);
  void insert_keyframe(Present& now);
  /// Keeps what look_again() needs of a frame that was tracked.
  void remember_last(Present& now, const cv::Mat& moves);
  /// Makes the last frame a keyframe with points of all that it saw and that was not found moving, proven or
  /// not, under an a-priori mask or not. @return false: nothing to look at
  bool look_again();
  void insert_last(int tracked);
  int make_first_points(const ImagePyramid& pyramid, Frame& frame);
  /// Makes the frame at hand the reference keyframe of the geometry.
  void set_reference(const Frame& frame);

  /// Time since the last frame, where the motion since then tells of the motion during this one [s].
  [[nodiscard]] std::optional<double> interval(const RgbdFrame& input) const;
  /// How much later than colour depth was taken [s]; 0: at once, or nobody knows, or the motion meanwhile is
  /// not known.
  [[nodiscard]] double depth_delay(const RgbdFrame& input) const;
  /// Where the camera was when the depth image was taken, by its motion since the last frame.
  [[nodiscard]] std::optional<SE3<double>> depth_motion(const RgbdFrame& input,
                                                        const SE3<double>& T_c_last) const;
  /// How it moved while the colour image was read, by the same.
  [[nodiscard]] RollingShutter<double> shutter(const RgbdFrame& input, const SE3<double>& T_c_last) const;
  /// The camera's speed at a frame [m/s, rad/s]. @param interval  since the last [s]
  [[nodiscard]] SE3<double>::Vector6 speed(const SE3<double>& T_c_last, double interval) const;
  [[nodiscard]] bool reachable(const SE3<double>& T_c_w, double t) const;
  [[nodiscard]] bool wants_keyframe(const Present& now) const;
  void end_last_keyframe();
  /// Starts the bundle adjustment that a keyframe asked for.
  void start_bundle();
  /// Waits for the bundle adjustment, if one runs, and uses it. @return the correction, see follow()
  SE3<double> settle();
  /// Moves what was placed relative to the newest keyframe: new T_c_w = old T_c_w D.
  void follow(const SE3<double>& D);

  CameraConfig camera_;
  TrackerOptions options_;
  Additions additions_;
  FeatureExtractor extractor_;
  LocalMatcher<decltype(CameraConfig::model)> matcher_;
  MatchedPose<double> pose_;
  MaskedPoseWorkspace masked_pose_;
  PointMaker<double> points_;
  MotionSegmenter<double, decltype(CameraConfig::model)> geometry_;
  LastView last_view_;  // for align_with_last()
  LocalMap map_;
  LocalBundle bundle_;
  PlaceIndex places_;
  PlaceVerifier verifier_;
  LoopCloser loops_;
  std::vector<std::pair<int, int>> places_found_;
  std::vector<int> votes_;
  std::size_t bundle_due_ = 0;        // frame index
  std::optional<int> wanted_bundle_;  // its window: it starts when the last frame is revised
  std::size_t adjustments_ = 0;
  Frame last_;
  std::int64_t last_ns_ = 0;
  int last_reference_ = 0;
  RollingShutter<double> last_shutter_;  // by which the last frame's features were placed
  std::optional<int> inserted_;          // keyframe that the last frame became
  Frame revised_;                        // of revise_last(): features, points and flags, whose memory is kept
  ImagePyramid last_pyramid_;            // for look_again()
  double usual_inliers_ = 0;  // of the frames before: the most, less by a share for each frame since
  cv::Mat last_moving_;       // what the geometry found in the last frame, CV_8UC1
  SE3<double> velocity_;  // T_c_last
  std::optional<ReadoutMeasurement<double>> readout_;
  double velocity_interval_ = 0;  // over which it was measured [s]; 0: it was not
  bool initialised_ = false;
  std::size_t first_ = 0;       // index of the frame that began the map
  bool began_at_rest_ = false;  // the last frame began the map, by a camera whose motion nobody knew
  int lost_frames_ = 0;
  std::vector<Lost> lost_;     // since then, unless they are too many
  SE3<double> lost_velocity_;  // velocity_ and its interval before
  double lost_interval_ = 0;
  std::size_t frames_ = 0;            // tracked or lost so far
  std::optional<double> last_t_;      // of the frame before [s]
  int reference_id_ = 0;              // keyframe beside which the geometry's reference stands
  SE3<double> T_reference_keyframe_;  // and how
  std::size_t last_keyframe_index_ = 0;
  int last_keyframe_tracked_ = 0;
  cv::Mat standing_;                       // what stands in the place where it stood long before, CV_8UC1
  std::optional<double> last_keyframe_t_;  // empty until this run has one [s]
};
// A thread of its own adjusts the map through pointers to its members.
static_assert(!std::is_move_constructible_v<Tracker> && !std::is_move_assignable_v<Tracker>);

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
