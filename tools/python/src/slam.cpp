// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/slam.hpp"

#include <fmt/format.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <chrono>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>

#include "arrays.hpp"
#include "bindings.hpp"
#include "dynslam/runtime/error.hpp"
#include "map.hpp"
#include "sequence.hpp"
#include "trajectory.hpp"

namespace dynslam::python {

namespace {

using runtime::SlamOptions;
using runtime::TrackResult;

class PythonSlam {
 public:
  PythonSlam(const runtime::CameraConfig& camera, const SlamOptions& options)
      : camera_(camera), slam_(camera, options) {}

  TrackResult track(const py::object& image, const py::object& depth, std::optional<double> t,
                    const std::optional<std::int64_t>& ns, const py::object& prior, double depth_delay) {
    const cv::Mat colour = colour_image(image, "image", size()),
                  measured = depth_image(depth, "depth", size());
    const auto masks = masks_of(prior);
    if (t.has_value() == ns.has_value()) throw py::type_error("t, ns: expected one of the two");
    if (t) finite(*t, "t");
    finite(depth_delay, "depth_delay");
    return slam_.use([&](runtime::Slam& slam) {
      return ns ? slam.track(colour, measured, std::chrono::nanoseconds(*ns), masks, depth_delay)
                : slam.track(colour, measured, *t, masks, depth_delay);
    });
  }
  TrackResult track_frame(const Frame& frame, const py::object& prior) {
    const auto masks = masks_of(prior);
    return slam_.use([&](runtime::Slam& slam) { return slam.track(frame.frame, masks); });
  }
  void finish() {
    slam_.use([](runtime::Slam& slam) { slam.finish(); });
  }
  [[nodiscard]] Trajectory trajectory() {
    return slam_.use([](runtime::Slam& slam) { return Trajectory{slam.trajectory()}; });
  }
  [[nodiscard]] Trajectory live_trajectory() {
    return slam_.use([](runtime::Slam& slam) { return Trajectory{slam.live_trajectory()}; });
  }
  [[nodiscard]] Trajectory keyframe_trajectory() {
    return slam_.use([](runtime::Slam& slam) { return Trajectory{slam.keyframe_trajectory()}; });
  }
  /// A copy, which later frames leave as it is.
  [[nodiscard]] std::optional<Map> map() {
    return slam_.use([](runtime::Slam& slam) -> std::optional<Map> {
      if (slam.whole()) slam.finish();
      if (!slam.whole()) throw runtime::UsageError("Slam.map(): the map is in pieces after an error");
      if (slam.octree() == nullptr) return std::nullopt;
      return Map{std::make_shared<interop::SemanticOcTree>(*slam.octree()), {}};
    });
  }
  void save(const std::filesystem::path& folder) {
    slam_.use([&](runtime::Slam& slam) { slam.save(folder); });
  }
  void load(const std::filesystem::path& folder) {
    slam_.use([&](runtime::Slam& slam) { slam.load(folder); });
  }
  void save_map(const std::filesystem::path& folder) {
    slam_.use([&](runtime::Slam& slam) { slam.save_octree(folder); });
  }
  void reset() {
    slam_.use([](runtime::Slam& slam) { slam.reset(); });
  }

 private:
  [[nodiscard]] cv::Size size() const { return {camera_.width, camera_.height}; }
  [[nodiscard]] std::optional<runtime::Masks> masks_of(const py::object& prior) const {
    if (prior.is_none()) return std::nullopt;
    runtime::Masks masks;
    masks.dynamic = optional_mask(prior, "prior", size()) != 0;  // a copy: the octree's thread keeps it
    return masks;
  }

  runtime::CameraConfig camera_;
  Shared<runtime::Slam> slam_;
};

SlamOptions options_of(const std::string& dynamics, const std::optional<std::filesystem::path>& model,
                       bool map, double map_resolution, std::uint64_t seed) {
  SlamOptions options;
  const auto mode = runtime::parse_dynamics(dynamics);
  if (!mode)
    throw py::value_error("dynamics: expected 'none', 'semantic', 'geometric' or 'both', got '" + dynamics +
                          "'");
  if (!(map_resolution >= 0.001 && map_resolution <= 10))
    throw py::value_error(fmt::format("map_resolution: expected 0.001 to 10 m, got {}", map_resolution));
  options.dynamics = *mode;
  options.map = map;
  options.map_resolution = map_resolution;
  options.seed = seed;
  if (model) options.network.emplace().segmenter.model = *model;
  return options;
}

void bind_result(py::module_& m) {
  py::class_<TrackResult>(m, "TrackResult", "What tracking a frame gave.")
      .def_property_readonly("ok", &TrackResult::ok, "Whether the camera is known.")
      .def_property_readonly(
          "state", [](const TrackResult& r) { return to_string(r.state); },
          "'not initialised', 'tracked', 'relocalised' or 'lost'.")
      .def_property_readonly(
          "T_w_c",
          [](const TrackResult& r) -> py::object {
            return r.ok() ? py::object(to_array(r.T_w_c)) : py::object(py::none());
          },
          "Camera to world, (4, 4) float64 [m], as known now; None unless ok.")
      .def_property_readonly(
          "mask", [](const TrackResult& r) { return mask_array(r.dynamic_mask); },
          "(H, W) uint8: 255 what moves, 128 what only may move (with masks), 0 the rest.")
      .def_property_readonly(
          "covariance",
          [](const TrackResult& r) {
            py::array_t<double> result({6, 6});
            Eigen::Map<Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(result.mutable_data()) = r.covariance;
            return result;
          },
          "(6, 6) float64 of the left increment [m, rad] of T_w_c; zero where unknown.")
      .def_readonly("keyframe", &TrackResult::keyframe)
      .def_property_readonly(
          "loop", [](const TrackResult& r) { return r.loop.has_value(); }, "A loop was closed at this frame.")
      .def_readonly("matches", &TrackResult::matches)
      .def_readonly("inliers", &TrackResult::inliers)
      .def("__repr__", [](const TrackResult& r) {
        return fmt::format("<dynslam.TrackResult {}, {} inliers>", to_string(r.state), r.inliers);
      });
}

}  // namespace

void bind_slam(py::module_& m) {
  bind_result(m);
  py::class_<PythonSlam>(m, "Slam",
                         "RGB-D SLAM: frames in, poses, masks and a map out; the same as `dynslam run`.")
      .def(py::init([](const runtime::CameraConfig& camera, const std::string& dynamics,
                       const std::optional<std::filesystem::path>& model, bool map, double map_resolution,
                       std::uint64_t seed) {
             const SlamOptions options = options_of(dynamics, model, map, map_resolution, seed);
             const py::gil_scoped_release released;
             return std::make_unique<PythonSlam>(camera, options);
           }),
           py::arg("camera"), py::kw_only(), py::arg("dynamics") = "geometric", py::arg("model") = py::none(),
           py::arg("map") = true, py::arg("map_resolution") = 0.05, py::arg("seed") = 1,
           "dynamics: which masks remove features, 'none', 'semantic', 'geometric' or 'both'. model: a "
           "segmentation network "
           "(.onnx) for 'semantic' and 'both'. map: build the octree; map_resolution: its voxels' edge [m].")
      .def("track", &PythonSlam::track_frame, py::arg("frame"), py::arg("prior") = py::none(),
           "Tracks a Frame of load_sequence(). Returns a TrackResult.")
      .def("track", &PythonSlam::track, py::arg("image"), py::arg("depth"), py::arg("t") = py::none(),
           py::kw_only(), py::arg("ns") = py::none(), py::arg("prior") = py::none(),
           py::arg("depth_delay") = 0.0,
           "Tracks images. image: (H, W, 3) uint8 BGR, (H, W, 4) BGRA or (H, W) grey. depth: (H, W) float32 "
           "[m], NaN or <= 0: "
           "none, or uint16 in the camera's units, 0: none. t: [s], later than the frame's before; ns: the "
           "same as an integer "
           "[ns], instead of it. prior: (H, W) uint8 or bool, what may move. depth_delay: time of depth less "
           "that of the image "
           "[s]. Returns a TrackResult. Python's other threads run meanwhile.")
      .def("finish", &PythonSlam::finish,
           "Waits for adjustment and map. Call it before results are read; more frames may follow.")
      .def_property_readonly("trajectory", &PythonSlam::trajectory,
                             "Trajectory of all frames, after loops and adjustments.")
      .def_property_readonly("live_trajectory", &PythonSlam::live_trajectory,
                             "Poses as track() returned them.")
      .def_property_readonly("keyframe_trajectory", &PythonSlam::keyframe_trajectory)
      .def("map", &PythonSlam::map, "A copy of the semantic map as it is now; None without one.")
      .def("save_map", &PythonSlam::save_map, py::arg("folder"),
           "Writes map.sot, and map_color.ot for octovis.")
      .def("save", &PythonSlam::save, py::arg("folder"), "Saves everything for load().")
      .def("load", &PythonSlam::load, py::arg("folder"), "Goes on in a saved map; before the first frame.")
      .def("reset", &PythonSlam::reset, "Forgets all frames and maps.");
}

}  // namespace dynslam::python
