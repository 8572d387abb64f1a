// SPDX-License-Identifier: BSD-3-Clause
#include <fmt/format.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "bindings.hpp"
#include "dynslam/dynamics/motion_segmenter.hpp"
#include "dynslam/interop/opencv.hpp"
#include "dynslam/runtime/slam/dynamics_mode.hpp"

namespace dynslam::python {

namespace {

using Segmenter = MotionSegmenter<double, AnyCamera<double>>;

std::string_view name(MotionStatus status) {
  constexpr std::array<std::string_view, 5> kNames{"ok", "size_mismatch", "time_not_later",
                                                   "pose_unsupported", "covers_view"};
  return kNames.at(static_cast<std::size_t>(status));
}

/// What segment() returns; the array is the caller's.
struct FoundMotion {
  py::array_t<std::uint8_t> mask;
  MotionStatus status = MotionStatus::ok;
  bool own_pose = false;
  SE3<double> T_c_w;
  int tracked = 0, dynamic_matches = 0, mismatches = 0;
  std::vector<JudgedMatch<double>> matches;

  /// A number of each match.
  template <class Out, class F>
  [[nodiscard]] py::array_t<Out> of_matches(F&& number) const {
    py::array_t<Out> result(static_cast<py::ssize_t>(matches.size()));
    std::transform(matches.begin(), matches.end(), result.mutable_data(), number);
    return result;
  }
  [[nodiscard]] py::array_t<double> pixels() const {
    py::array_t<double> result({static_cast<py::ssize_t>(matches.size()), py::ssize_t(2)});
    double* out = result.mutable_data();
    for (const auto& match : matches) out = std::copy_n(match.x_m.data(), 2, out);
    return result;
  }
};

/// The segmenter with its camera. Sizes of images are the camera's.
class PythonSegmenter {
 public:
  PythonSegmenter(const runtime::CameraConfig& camera, const Segmenter::Options& options)
      : camera_(camera), segmenter_(camera.model, options) {}

  FoundMotion segment(const py::object& gray, const py::object& depth, double t, const py::object& T_c_w,
                      const py::object& prior, const py::object& out) {
    const cv::Mat grey = gray_image(gray, "gray", size()), metres = metric_depth(depth, "depth", camera_);
    const cv::Mat may_move = optional_mask(prior, "prior", size());
    const SE3<double> pose = rigid_motion(T_c_w, "T_c_w");
    const py::object target =
        out.is_none() ? py::object(py::array_t<std::uint8_t>({camera_.height, camera_.width})) : out;
    cv::Mat mask = output_mask(target, "out", size());
    FoundMotion result;
    result.mask = py::reinterpret_borrow<py::array_t<std::uint8_t>>(target);
    segmenter_.use([&](Segmenter& s) {
      const MotionResult<double>& motion =
          s.segment(view(grey), interop::view<const float>(metres), t, pose, view(may_move));
      result.status = motion.status;
      result.own_pose = motion.own_pose;
      result.T_c_w = motion.T_c_w;
      result.tracked = motion.tracked;
      result.dynamic_matches = motion.dynamic_matches;
      result.mismatches = motion.mismatches;
      result.matches = motion.matches;
      if (motion.ok()) {
        cv::Mat(size(), CV_8UC1, const_cast<std::uint8_t*>(motion.mask.data())).copyTo(mask);
      } else {
        mask.setTo(0);
      }
    });
    return result;
  }

  std::pair<py::array_t<double>, bool> locate(const py::object& gray, const py::object& depth,
                                              const py::object& predicted, const py::object& prior) {
    const cv::Mat grey = gray_image(gray, "gray", size()), metres = metric_depth(depth, "depth", camera_);
    const cv::Mat may_move = optional_mask(prior, "prior", size());
    const SE3<double> pose = rigid_motion(predicted, "T_c_w_predicted");
    const auto located = segmenter_.use([&](Segmenter& s) {
      return s.locate(view(grey), interop::view<const float>(metres), pose, view(may_move));
    });
    return {to_array(located.T_c_w), located.ok()};
  }

  void remember(const py::object& T_c_w, const py::object& mask) {
    const cv::Mat dynamic = optional_mask(mask, "mask", size());
    const SE3<double> pose = rigid_motion(T_c_w, "T_c_w");
    segmenter_.use([&](Segmenter& s) { s.remember(pose, view(dynamic)); });
  }
  void reset() {
    segmenter_.use([](Segmenter& s) { s.reset(); });
  }
  void follow(const py::object& D) {
    const SE3<double> correction = rigid_motion(D, "D");
    segmenter_.use([&](Segmenter& s) { s.follow(correction); });
  }

 private:
  [[nodiscard]] cv::Size size() const { return {camera_.width, camera_.height}; }
  static ImageView<const std::uint8_t> view(const cv::Mat& image) {
    return interop::view<const std::uint8_t>(image);
  }

  runtime::CameraConfig camera_;
  Shared<Segmenter> segmenter_;
};

Segmenter::Options options_of(const runtime::CameraConfig& camera, const std::string& method,
                              bool pose_check) {
  Segmenter::Options options;
  const auto parsed = runtime::parse_method(method);
  if (!parsed) throw py::value_error("method: expected 'full' or 'paper', got '" + method + "'");
  options.method = *parsed;
  options.pose_check.use = pose_check;
  if (camera.depth_noise) options.weights.depth_noise = *camera.depth_noise;
  return options;
}

void bind_motion(py::module_& m) {
  py::class_<FoundMotion>(m, "MotionResult", "What moves in a frame.")
      .def_readonly("mask", &FoundMotion::mask, "(H, W) uint8, 255 where something moves; all 0 unless ok.")
      .def_property_readonly(
          "status", [](const FoundMotion& f) { return name(f.status); },
          "'ok', 'time_not_later', 'pose_unsupported' or 'covers_view': no mask is given but with 'ok'.")
      .def_property_readonly("ok", [](const FoundMotion& f) { return f.status == MotionStatus::ok; })
      .def_readonly("own_pose", &FoundMotion::own_pose,
                    "The keypoints contradict T_c_w: a pose of the segmenter's own was used.")
      .def_property_readonly(
          "T_c_w", [](const FoundMotion& f) { return to_array(f.T_c_w); },
          "(4, 4) float64, the pose that the mask rests on, yours or the segmenter's own: a start for your tracker.")
      .def_property_readonly("pixels", &FoundMotion::pixels,
                             "Keypoints that were classified, (N, 2) float64 [px] in this frame.")
      .def_property_readonly(
          "weights",
          [](const FoundMotion& f) {
            return f.of_matches<double>([](const JudgedMatch<double>& match) { return match.weight; });
          },
          "Their static weights, (N,) float64, Eq (7).")
      .def_property_readonly(
          "dynamic",
          [](const FoundMotion& f) {
            return f.of_matches<bool>([](const JudgedMatch<double>& match) { return match.dynamic; });
          },
          "Which of them move, (N,) bool.")
      .def_readonly("tracked", &FoundMotion::tracked, "Keypoints of the reference that were found.")
      .def_readonly("dynamic_matches", &FoundMotion::dynamic_matches, "Of these, those that move.")
      .def_readonly("mismatches", &FoundMotion::mismatches, "Of these, those off their epipolar curve.");
}

}  // namespace

void bind_segmenter(py::module_& m) {
  bind_motion(m);
  py::class_<PythonSegmenter>(
      m, "MotionSegmenter",
      "Finds what moves in RGB-D images without knowing what it is, inside any SLAM system.")
      .def(py::init([](const runtime::CameraConfig& camera, const std::string& method, bool pose_check) {
             return std::make_unique<PythonSegmenter>(camera, options_of(camera, method, pose_check));
           }),
           py::arg("camera"), py::kw_only(), py::arg("method") = "full", py::arg("pose_check") = true)
      .def("segment", &PythonSegmenter::segment, py::arg("gray"), py::arg("depth"), py::arg("t"),
           py::arg("T_c_w"), py::arg("prior") = py::none(), py::arg("out") = py::none(),
           "Finds what moves. gray: (H, W) uint8, or float32 or float64 from 0 to 255. depth: (H, W) float32 "
           "[m], NaN or <= 0: "
           "none, or uint16 in the camera's units. t: [s], later than the frame remembered before. T_c_w: "
           "(4, 4) world to camera [m], "
           "as known so far. prior: (H, W) uint8 or bool, what may move (a network's people). out: (H, W) "
           "uint8 that takes the "
           "mask. Returns a MotionResult.")
      .def("locate", &PythonSegmenter::locate, py::arg("gray"), py::arg("depth"), py::arg("T_c_w_predicted"),
           py::arg("prior") = py::none(),
           "A pose for segment(), of a host whose own is not yet to be trusted: (T_c_w (4, 4), found). The "
           "prediction where not "
           "found.")
      .def("remember", &PythonSegmenter::remember, py::arg("T_c_w"), py::arg("mask") = py::none(),
           "Keeps the frame last segmented, with its final pose and mask, as evidence. Once per frame.")
      .def("reset", &PythonSegmenter::reset,
           "Forgets all frames: the clock was set back, or another sequence begins.")
      .def("follow", &PythonSegmenter::follow, py::arg("D"),
           "Moves what is remembered with the map, after a loop or an adjustment: new T_c_w = old T_c_w @ D, "
           "(4, 4).");
}

}  // namespace dynslam::python
