// SPDX-License-Identifier: BSD-3-Clause
#include "sequence.hpp"

#include <fmt/format.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <filesystem>
#include <optional>
#include <string>
#include <utility>

#include "arrays.hpp"
#include "bindings.hpp"
#include "dynslam/runtime/io/frame_stream.hpp"
#include "dynslam/runtime/io/sequence.hpp"
#include "trajectory.hpp"

namespace dynslam::python {

namespace {

struct Recording {
  runtime::Sequence sequence;
  runtime::CameraConfig camera;
};

using Frames = Shared<runtime::FrameStream>;

Recording load_recording(const std::filesystem::path& path, const std::string& camera,
                         const std::string& format, const std::string& topics, double rate) {
  const py::gil_scoped_release released;
  runtime::SequenceOptions options;
  options.camera = camera;
  options.format = format;
  options.topics = topics;
  options.rate = rate;
  Recording result{runtime::load_sequence(path, options), {}};
  result.camera = camera_of(result.sequence, camera);
  return result;
}

/// The next frame that can be decoded; a warning for each that cannot, as `dynslam run` has it.
Frame next_frame(Frames& frames) {
  for (;;) {
    std::optional<runtime::FrameResult> next =
        frames.use([](runtime::FrameStream& stream) { return stream.next(); });
    if (!next) throw py::stop_iteration();
    if (next->frame) return {std::move(*next->frame)};
    if (PyErr_WarnEx(PyExc_RuntimeWarning, next->error.c_str(), 1) != 0) throw py::error_already_set();
  }
}

Frame frame_at(const Recording& recording, py::ssize_t index) {
  const auto count = static_cast<py::ssize_t>(recording.sequence.frames.size());
  if (index < 0) index += count;
  if (index < 0 || index >= count) throw py::index_error(fmt::format("the sequence has {} frames", count));
  const py::gil_scoped_release released;
  const auto i = static_cast<std::size_t>(index);
  return {runtime::decode_frame(recording.sequence.frames[i], i, recording.camera)};
}

void bind_frame(py::module_& m) {
  py::class_<Frame>(m, "Frame", "A frame of a sequence. Its arrays are read-only and are not copied.")
      .def_property_readonly(
          "index", [](const Frame& f) { return f.frame.index; }, "In the sequence, from 0.")
      .def_property_readonly(
          "t", [](const Frame& f) { return f.frame.t; }, "Time of the colour image [s].")
      .def_property_readonly(
          "ns", [](const Frame& f) { return f.frame.ns; }, "The same as recorded [ns]; 0: unknown.")
      .def_property_readonly(
          "depth_delay", [](const Frame& f) { return f.frame.depth_delay; },
          "Time of the depth image less that of the colour image [s].")
      .def_property_readonly(
          "stamp", [](const Frame& f) { return f.frame.stamp; }, "Time or number as the sequence prints it.")
      .def_property_readonly(
          "bgr", [](const Frame& f) { return image_array(f.frame.bgr); },
          "(H, W, 3) uint8: blue, green, red.")
      .def_property_readonly(
          "gray", [](const Frame& f) { return image_array(f.frame.gray); }, "(H, W) uint8.")
      .def_property_readonly(
          "depth", [](const Frame& f) { return image_array(f.frame.depth); },
          "(H, W) float32 [m], NaN or <= 0: none.");
}

}  // namespace

void bind_sequence(py::module_& m) {
  bind_frame(m);
  py::class_<Frames>(m, "_Frames")
      .def("__iter__", [](py::object self) { return self; })
      .def("__next__", &next_frame);
  py::class_<Recording>(m, "Sequence", "A recorded sequence. Iterating decodes its frames ahead on a thread.")
      .def_property_readonly("camera", [](const Recording& r) { return r.camera; })
      .def_property_readonly("format", [](const Recording& r) { return r.sequence.format; })
      .def_property_readonly(
          "notes", [](const Recording& r) { return r.sequence.notes; }, "What is left out or missing.")
      .def_property_readonly(
          "groundtruth",
          [](const Recording& r) -> std::optional<Trajectory> {
            if (r.sequence.groundtruth.empty()) return std::nullopt;
            return Trajectory{r.sequence.groundtruth, r.sequence.truth_file.string()};
          },
          "Trajectory, or None.")
      .def("__len__", [](const Recording& r) { return r.sequence.frames.size(); })
      .def("__iter__", [](const Recording& r) { return std::make_unique<Frames>(r.sequence, r.camera); })
      .def("__getitem__", &frame_at, py::arg("index"))
      .def("__repr__", [](const Recording& r) {
        return fmt::format("<dynslam.Sequence {} ({}), {} frames>", r.sequence.root.string(),
                           r.sequence.format, r.sequence.frames.size());
      });
  m.def("load_sequence", &load_recording, py::arg("path"), py::kw_only(), py::arg("camera") = "",
        py::arg("format") = "", py::arg("topics") = "", py::arg("rate") = 30.0,
        "Opens a folder or recording of any format that `dynslam run` reads; images are decoded when they "
        "are asked for. "
        "camera: a name or file that goes before the sequence's own; format, topics, rate: as the options of "
        "`dynslam run`.");
}

}  // namespace dynslam::python
