// SPDX-License-Identifier: BSD-3-Clause
#include "trajectory.hpp"

#include <fmt/format.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <variant>

#include "arrays.hpp"
#include "bindings.hpp"
#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/evaluation/evaluate.hpp"
#include "dynslam/runtime/io/trajectory_io.hpp"

namespace dynslam::python {

namespace {

Trajectory make_trajectory(const py::object& t, const py::object& T_w_c) {
  const auto times =
      number_rows(py::module_::import("numpy").attr("reshape")(t, py::make_tuple(-1, 1)), "t", 1);
  const auto poses = py::array::ensure(T_w_c);
  if (!poses || poses.ndim() != 3 || poses.shape(0) != times.rows())
    throw py::value_error(
        fmt::format("T_w_c: expected rigid motions ({}, 4, 4), one per time", times.rows()));
  Trajectory result;
  for (Eigen::Index k = 0; k < times.rows(); ++k)
    result.poses.push_back({times(k, 0), rigid_motion(poses[py::int_(k)], "T_w_c"), 0});
  if (!std::is_sorted(result.poses.begin(), result.poses.end(),
                      [](const auto& a, const auto& b) { return a.t < b.t; }))
    throw py::value_error("t: expected increasing times");
  return result;
}

py::array_t<double> times(const Trajectory& trajectory) {
  py::array_t<double> result(static_cast<py::ssize_t>(trajectory.poses.size()));
  std::transform(trajectory.poses.begin(), trajectory.poses.end(), result.mutable_data(),
                 [](const auto& p) { return p.t; });
  return result;
}

py::array_t<double> matrices(const Trajectory& trajectory) {
  using Matrix4 = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;
  py::array_t<double> result(
      {static_cast<py::ssize_t>(trajectory.poses.size()), py::ssize_t(4), py::ssize_t(4)});
  double* out = result.mutable_data();
  for (const auto& pose : trajectory.poses) {
    Eigen::Map<Matrix4>{out} = pose.T_w_c.matrix();
    out += 16;
  }
  return result;
}

using Comparable = std::variant<Trajectory, std::filesystem::path>;

py::object evaluate(const Comparable& estimate, const Comparable& groundtruth, const std::string& align,
                    const std::optional<std::variant<double, std::string>>& offset) {
  runtime::EvaluationOptions options;
  const auto alignment = runtime::parse_alignment(align);
  if (!alignment)
    throw py::value_error("align: expected 'se3', 'sim3', 'first' or 'none', got '" + align + "'");
  options.alignment = *alignment;
  if (offset && std::holds_alternative<double>(*offset))
    options.offset = finite(std::get<double>(*offset), "offset");
  if (offset && std::holds_alternative<std::string>(*offset)) {
    if (std::get<std::string>(*offset) != "auto") throw py::value_error("offset: expected seconds or 'auto'");
    options.find_offset = true;
  }
  std::string json;
  {
    const py::gil_scoped_release released;
    const auto* a = std::get_if<std::filesystem::path>(&estimate);
    const auto* b = std::get_if<std::filesystem::path>(&groundtruth);
    if (a != nullptr && b != nullptr) {
      json = to_json(runtime::evaluate_trajectory(*a, *b, options)).dump();
    } else {
      const auto poses_of = [](const Comparable& what, const std::filesystem::path* file) {
        if (file == nullptr) return std::get<Trajectory>(what);
        if (!runtime::formats_of(*file).empty())
          return Trajectory{runtime::load_sequence(*file).groundtruth, file->string()};
        return Trajectory{runtime::read_trajectory(*file), file->string()};
      };
      const Trajectory first = poses_of(estimate, a), second = poses_of(groundtruth, b);
      json =
          to_json(runtime::evaluate_trajectory(first.poses, second.poses, first.name, second.name, options))
              .dump();
    }
  }
  return py::module_::import("json").attr("loads")(json);
}

}  // namespace

void bind_trajectory(py::module_& m) {
  py::class_<Trajectory>(m, "Trajectory", "Poses with their times, in order of time.")
      .def(py::init(&make_trajectory), py::arg("t"), py::arg("T_w_c"),
           "Of times (N,) [s] and camera-to-world poses (N, 4, 4).")
      .def_static(
          "load",
          [](const std::filesystem::path& file) {
            const py::gil_scoped_release released;
            return Trajectory{runtime::read_trajectory(file), file.string()};
          },
          py::arg("file"), "Of a file in TUM format: lines of `t tx ty tz qx qy qz qw`.")
      .def(
          "save",
          [](const Trajectory& self, const std::filesystem::path& file) {
            runtime::write_trajectory(file, self.poses);
          },
          py::arg("file"), "Writes TUM format, as `dynslam run` does.")
      .def_property_readonly("t", &times, "Times, (N,) float64 [s].")
      .def_property_readonly("T_w_c", &matrices, "Camera to world, (N, 4, 4) float64 [m].")
      .def("__len__", [](const Trajectory& self) { return self.poses.size(); })
      .def("__repr__", [](const Trajectory& self) {
        return fmt::format("<dynslam.Trajectory of {} poses>", self.poses.size());
      });

  m.def("evaluate", &evaluate, py::arg("estimate"), py::arg("groundtruth"), py::kw_only(),
        py::arg("align") = "se3", py::arg("offset") = py::none(),
        "ATE and RPE (1 s) as `dynslam eval` gives them: {'pairs', 'ate_m', 'rpe_trans_m', 'rpe_rot_deg', "
        "...}, errors as "
        "{'rmse', 'mean', 'median', 'std', 'min', 'max'}. Each argument is a Trajectory, a file in TUM "
        "format or a folder (of "
        "a run; of a sequence). align: 'se3', 'sim3', 'first' or 'none'; offset: seconds to add to the "
        "estimate's times, or "
        "'auto'.");
}

}  // namespace dynslam::python
