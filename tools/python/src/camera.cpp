// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/io/camera.hpp"

#include <fmt/format.h>
#include <pybind11/stl/filesystem.h>

#include <filesystem>
#include <limits>
#include <sstream>
#include <string>

#include "arrays.hpp"
#include "bindings.hpp"

namespace dynslam::python {

namespace {

/// A preset that is installed beside the module; else the name as it is.
std::string with_own_presets(const std::string& name_or_file) {
  std::error_code error;
  if (name_or_file.find('/') != std::string::npos || std::filesystem::exists(name_or_file, error))
    return name_or_file;
  const auto module = py::module_::import("dynslam").attr("__file__").cast<std::filesystem::path>();
  const auto preset = module.parent_path() / "cameras" / (name_or_file + ".txt");
  return std::filesystem::exists(preset, error) ? preset.string() : name_or_file;
}

/// A number or word as a camera file has it.
std::string text_of(const py::handle& key, const py::handle& value) {
  if (py::isinstance<py::str>(value)) return value.cast<std::string>();
  if (PyIndex_Check(value.ptr()) != 0)
    return py::str(py::reinterpret_steal<py::object>(PyNumber_Index(value.ptr())));
  if (PyNumber_Check(value.ptr()) == 0)
    throw py::type_error(fmt::format("{}: expected a number or a word", py::str(key).cast<std::string>()));
  return py::repr(py::float_(py::reinterpret_borrow<py::object>(value)));
}

/// The camera of a file with these keys.
runtime::CameraConfig camera_of_keys(const py::dict& keys) {
  std::stringstream text;
  for (const auto& [key, value] : keys)
    text << py::str(key).cast<std::string>() << " = " << text_of(key, value) << '\n';
  return runtime::parse_camera(text, "Camera");
}

runtime::CameraConfig pinhole(int width, int height, double fx, double fy, double cx, double cy, double units,
                              const py::dict& keys) {
  py::dict all;
  all["width"] = width;
  all["height"] = height;
  all["fx"] = fx;
  all["fy"] = fy;
  all["cx"] = cx;
  all["cy"] = cy;
  all["depth_units_per_metre"] = units;
  for (const auto& [key, value] : keys) all[key] = value;
  return camera_of_keys(all);
}

/// Points [m] of pixels at depths [m]; NaN where the lens sees nothing.
py::array_t<double> unproject(const runtime::CameraConfig& camera, const py::object& x, const py::object& z) {
  const auto pixels = number_rows(x, "x", 2, false);
  const auto depths =
      number_rows(py::module_::import("numpy").attr("reshape")(z, py::make_tuple(-1, 1)), "z", 1, false);
  if (depths.rows() != pixels.rows())
    throw py::value_error(
        fmt::format("z: expected {} depths, one per pixel, got {}", pixels.rows(), depths.rows()));
  py::array_t<double> points({pixels.rows(), Eigen::Index(3)});
  Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>> out(points.mutable_data(),
                                                                            pixels.rows(), 3);
  out.setConstant(std::numeric_limits<double>::quiet_NaN());
  for (Eigen::Index k = 0; k < pixels.rows(); ++k) {
    if (!is_valid_depth(depths(k, 0))) continue;
    if (const auto p = camera.model.unproject(pixels.row(k).transpose(), depths(k, 0)))
      out.row(k) = p->transpose();
  }
  return points;
}

/// Pixels of points; NaN where the camera does not see them.
py::array_t<double> project(const runtime::CameraConfig& camera, const py::object& p) {
  const auto points = number_rows(p, "p", 3, false);
  py::array_t<double> pixels({points.rows(), Eigen::Index(2)});
  Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, 2, Eigen::RowMajor>> out(pixels.mutable_data(),
                                                                            points.rows(), 2);
  out.setConstant(std::numeric_limits<double>::quiet_NaN());
  for (Eigen::Index k = 0; k < points.rows(); ++k) {
    if (!points.row(k).allFinite()) continue;
    if (const auto x = camera.model.project(points.row(k).transpose())) out.row(k) = x->transpose();
  }
  return pixels;
}

}  // namespace

void bind_camera(py::module_& m) {
  using runtime::CameraConfig;
  py::class_<CameraConfig>(m, "Camera",
                           "A calibrated RGB-D camera whose depth is registered to the colour image.")
      .def(py::init([](const std::filesystem::path& name_or_file) {
             return runtime::load_camera(with_own_presets(name_or_file.string()));
           }),
           py::arg("name_or_file"),
           "A camera by name (fr1, fr2, fr3, bonn, realsense_d435, ...) or from a file: lines of `key = "
           "value`, ROS' "
           "camera_info, OpenCV's FileStorage, Open3D's JSON.")
      .def_static(
          "pinhole",
          [](int width, int height, double fx, double fy, double cx, double cy, double units,
             const py::kwargs& keys) { return pinhole(width, height, fx, fy, cx, cy, units, keys); },
          py::arg("width"), py::arg("height"), py::arg("fx"), py::arg("fy"), py::arg("cx"), py::arg("cy"),
          py::arg("depth_units_per_metre") = 1000.0,
          "A camera by numbers [px]. depth_units_per_metre is of uint16 depth images: 1000 where they are in "
          "millimetres. Further keywords are the keys of a camera file: model, k1, k2, p1, p2, k3, "
          "invalid_depth, ...")
      .def_readonly("name", &CameraConfig::name)
      .def_readonly("width", &CameraConfig::width, "[px]")
      .def_readonly("height", &CameraConfig::height, "[px]")
      .def_readonly("depth_units_per_metre", &CameraConfig::depth_units_per_metre, "Of uint16 depth images.")
      .def_property_readonly(
          "K",
          [](const CameraConfig& c) {
            const auto& k = c.model.pinhole();
            const double values[] = {k.fx(), 0, k.cx(), 0, k.fy(), k.cy(), 0, 0, 1};
            return py::array_t<double>({3, 3}, values);
          },
          "Camera matrix, (3, 3) float64 [px]; the lens is not in it.")
      .def("project", &project, py::arg("p"),
           "Recorded pixels (N, 2) of points (N, 3) [m] in the camera's frame; NaN: not seen.")
      .def("unproject", &unproject, py::arg("x"), py::arg("z"),
           "Points (N, 3) [m] of recorded pixels (N, 2) at depths (N,) [m]; NaN where there is none.")
      .def("__repr__", [](const CameraConfig& c) {
        const auto& k = c.model.pinhole();
        return fmt::format(
            "<dynslam.Camera {} {}x{} fx={:g} fy={:g} cx={:g} cy={:g} depth_units_per_metre={:g}>", c.name,
            c.width, c.height, k.fx(), k.fy(), k.cx(), k.cy(), c.depth_units_per_metre);
      });
}

}  // namespace dynslam::python
