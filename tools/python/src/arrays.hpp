// SPDX-License-Identifier: BSD-3-Clause
// Arguments of the module: numpy arrays as images and poses. What would read out of bounds is a TypeError (no
// array, another dtype) or a ValueError (another shape, strides, values) that names the argument, what it has
// to be and what it is.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "dynslam/geometry/se3.hpp"
#include "dynslam/image/image.hpp"
#include "dynslam/runtime/io/camera.hpp"

namespace dynslam::python {

namespace py = pybind11;

/// Images without a copy: headers over the array's memory, valid while the array lives. Rows may have any
/// distance; the pixels of a row must be beside each other.
/// @param name  of the argument
/// @param size  that it has to have
/// uint8 (H, W), (H, W, 3) BGR or (H, W, 4) BGRA.
[[nodiscard]] cv::Mat colour_image(const py::object& array, const char* name, cv::Size size);
/// uint16 (H, W) in the camera's units or float32 (H, W) in metres.
[[nodiscard]] cv::Mat depth_image(const py::object& array, const char* name, cv::Size size);
/// uint8 (H, W), or a copy of bool with 255 for True; 0 x 0 for None.
[[nodiscard]] cv::Mat optional_mask(const py::object& array, const char* name, cv::Size size);
/// uint8 (H, W) that may be written.
[[nodiscard]] cv::Mat output_mask(const py::object& array, const char* name, cv::Size size);

/// uint8 (H, W) without a copy; of float32 and float64, of grey values from 0 to 255, a rounded copy.
[[nodiscard]] cv::Mat gray_image(const py::object& array, const char* name, cv::Size size);
/// depth_image() in metres: a copy where it is uint16. @return CV_32FC1
[[nodiscard]] cv::Mat metric_depth(const py::object& array, const char* name,
                                   const runtime::CameraConfig& camera);

/// A rigid motion: anything that numpy reads as 4 x 4 numbers.
[[nodiscard]] SE3<double> rigid_motion(const py::object& matrix, const char* name);
/// N rows of so many finite numbers, as anything that numpy reads as such. @param finite  false: NaN and
/// infinity, too
[[nodiscard]] Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> number_rows(
    const py::object& array, const char* name, int columns, bool finite = true);
/// A point or direction, 3 finite numbers.
[[nodiscard]] Eigen::Vector3d point(const py::object& array, const char* name);
/// @throws py::value_error where a number is not finite
double finite(double value, const char* name);

/// (4, 4) float64.
[[nodiscard]] py::array_t<double> to_array(const SE3<double>& T);
/// A copy, (H, W) uint8.
[[nodiscard]] py::array_t<std::uint8_t> to_array(const Image<std::uint8_t>& image);
/// A copy of a CV_8UC1.
[[nodiscard]] py::array_t<std::uint8_t> mask_array(const cv::Mat& mask);
/// The matrix' own memory, read-only, which lives as long as the array.
[[nodiscard]] py::array image_array(const cv::Mat& image);

}  // namespace dynslam::python
