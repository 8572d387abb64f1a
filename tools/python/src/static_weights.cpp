// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/dynamics/static_weights.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "bindings.hpp"
#include "dynslam/interop/opencv.hpp"

namespace dynslam::python {

namespace {

using Result = StaticWeightsResult<double>;

template <class T, class Out = T>
py::array_t<Out> column(const std::vector<T>& values) {
  py::array_t<Out> result(static_cast<py::ssize_t>(values.size()));
  std::transform(values.begin(), values.end(), result.mutable_data(),
                 [](T value) { return static_cast<Out>(value); });
  return result;
}

std::vector<KeypointMatch<double>> matches_of(const py::object& x, const py::object& p_ref,
                                              const py::object& x_m, const py::object& masked) {
  const auto pixels = number_rows(x, "x", 2, false), points = number_rows(p_ref, "p_ref", 3, false),
             found = number_rows(x_m, "x_m", 2, false);
  const auto flags = masked.is_none() ? py::array_t<bool>() : py::array_t<bool, py::array::forcecast>(masked);
  if (points.rows() != pixels.rows() || found.rows() != pixels.rows() ||
      (!masked.is_none() && (flags.ndim() != 1 || flags.shape(0) != pixels.rows())))
    throw py::value_error(
        fmt::format("x, p_ref, x_m, masked: expected as many rows as x has, {}", pixels.rows()));
  std::vector<KeypointMatch<double>> matches;
  matches.reserve(static_cast<std::size_t>(pixels.rows()));
  for (Eigen::Index k = 0; k < pixels.rows(); ++k)
    matches.push_back({pixels.row(k).transpose(), points.row(k).transpose(), found.row(k).transpose(),
                       !masked.is_none() && flags.at(k)});
  return matches;
}

Result weigh(const runtime::CameraConfig& camera, const py::object& x, const py::object& p_ref,
             const py::object& x_m, const py::object& reference_gray, const py::object& gray,
             const py::object& depth, const py::object& T_cur_ref, const py::object& masked, bool paper) {
  const cv::Size size(camera.width, camera.height);
  const auto matches = matches_of(x, p_ref, x_m, masked);
  const cv::Mat before = gray_image(reference_gray, "reference_gray", size),
                now = gray_image(gray, "gray", size);
  const cv::Mat metres = metric_depth(depth, "depth", camera);
  const SE3<double> T = rigid_motion(T_cur_ref, "T_cur_ref");
  auto options = paper ? StaticWeightsOptions<double>::paper() : StaticWeightsOptions<double>();
  if (camera.depth_noise) options.depth_noise = *camera.depth_noise;
  const py::gil_scoped_release released;
  return static_weights(camera.model, matches, interop::view<const std::uint8_t>(before),
                        interop::view<const std::uint8_t>(now), interop::view<const float>(metres), T,
                        options);
}

std::string_view name(EpipolarVerdict verdict) {
  constexpr std::array<std::string_view, 3> kNames{"not_applicable", "planar", "applied"};
  return kNames.at(static_cast<std::size_t>(verdict));
}

}  // namespace

void bind_static_weights(py::module_& m) {
  py::class_<Result>(m, "StaticWeights", "Static weights, in the order of the matches; empty unless ok.")
      .def_property_readonly("ok", &Result::ok, "False: too few matches outside the mask.")
      .def_property_readonly(
          "weight", [](const Result& r) { return column(r.weight); },
          "(N,) float64, Eq (7); 0 for mismatches and what is not finite.")
      .def_property_readonly(
          "dynamic", [](const Result& r) { return column<std::uint8_t, bool>(r.dynamic); }, "(N,) bool.")
      .def_property_readonly(
          "mismatch", [](const Result& r) { return column<std::uint8_t, bool>(r.mismatch); },
          "(N,) bool: off its epipolar curve, Eq (8).")
      .def_property_readonly(
          "invalid", [](const Result& r) { return column<std::uint8_t, bool>(r.invalid); },
          "(N,) bool: not finite.")
      .def_property_readonly(
          "scales",
          [](const Result& r) {
            return py::make_tuple(r.scales.photometric, r.scales.reprojection, r.scales.depth);
          },
          "Of the errors: grey values, pixels, the sensor's standard deviations.")
      .def_readonly("exposure", &Result::exposure, "Median photometric error, taken off [grey values].")
      .def_property_readonly(
          "epipolar", [](const Result& r) { return name(r.epipolar); },
          "'applied', 'planar' or 'not_applicable'.");
  m.def("static_weights", &weigh, py::arg("camera"), py::arg("x"), py::arg("p_ref"), py::arg("x_m"),
        py::arg("reference_gray"), py::arg("gray"), py::arg("depth"), py::arg("T_cur_ref"), py::kw_only(),
        py::arg("masked") = py::none(), py::arg("paper") = false,
        "How much each match is that of a static point (paper, Sec. 3.2). x, x_m: (N, 2) recorded pixels in "
        "the reference and the "
        "present image; p_ref: (N, 3) points in the reference camera's frame [m] (Camera.unproject); "
        "reference_gray, gray, "
        "depth: images as MotionSegmenter.segment() takes them; T_cur_ref: (4, 4), the reference camera in "
        "the present one's "
        "frame; masked: (N,) bool, on something that may move. paper: Eq (7) as printed.");
}

}  // namespace dynslam::python
