// SPDX-License-Identifier: BSD-3-Clause
#include "arrays.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <memory>
#include <optional>

#include "io/frame_of_images.hpp"

namespace dynslam::python {

namespace {

/// As messages name it: "float64 (480, 640)".
std::string describe(const py::handle& object) {
  if (!py::isinstance<py::array>(object)) return py::str(py::type::handle_of(object).attr("__name__"));
  return py::str(object.attr("dtype")).cast<std::string>() + " " +
         py::str(object.attr("shape")).cast<std::string>();
}

std::string wrong(const char* name, const std::string& expected, const std::string& got) {
  return fmt::format("{}: expected {}, got {}", name, expected, got);
}

struct ImageRule {
  const char* name;
  const char* dtypes;  // for messages
  cv::Size size;
  bool colour = false;  // three or four channels, too
  bool output = false;

  [[nodiscard]] std::string expected() const {
    std::string shape = fmt::format("({}, {})", size.height, size.width);
    if (colour) shape += fmt::format(", ({0}, {1}, 3) or ({0}, {1}, 4)", size.height, size.width);
    return fmt::format("{}{} {}", output ? "writeable " : "", dtypes, shape);
  }
};

/// The array, if that is what it is.
py::array array_of(const py::object& object, const ImageRule& rule) {
  if (!py::isinstance<py::array>(object))
    throw py::type_error(wrong(rule.name, "a numpy array " + rule.expected(), describe(object)));
  return py::reinterpret_borrow<py::array>(object);
}

/// A header over an array whose elements are of OpenCV's `depth`.
cv::Mat header(const py::array& array, int depth, const ImageRule& rule) {
  const auto refuse = [&](const std::string& got) -> void {
    throw py::value_error(wrong(rule.name, rule.expected(), got));
  };
  const bool channels = rule.colour && array.ndim() == 3 && (array.shape(2) == 3 || array.shape(2) == 4);
  if ((array.ndim() != 2 && !channels) || array.shape(0) != rule.size.height ||
      array.shape(1) != rule.size.width)
    refuse(describe(array));
  if (rule.output && !array.writeable()) refuse("a read-only array");
  const int type = CV_MAKETYPE(depth, channels ? static_cast<int>(array.shape(2)) : 1);
  const auto pixel = static_cast<py::ssize_t>(CV_ELEM_SIZE(type)), value = array.itemsize();
  const bool dense =
      (array.strides(1) == pixel || array.shape(1) == 1) && (!channels || array.strides(2) == value);
  const bool rows =
      array.shape(0) == 1 || (array.strides(0) >= pixel * array.shape(1) && array.strides(0) % value == 0);
  if (!dense || !rows || (array.flags() & py::detail::npy_api::NPY_ARRAY_ALIGNED_) == 0)
    refuse(fmt::format(
        "strides {} whose rows are not contiguous (numpy.ascontiguousarray() makes a copy that has them so)",
        py::str(py::object(array.attr("strides"))).cast<std::string>()));
  const auto step = array.shape(0) == 1 ? pixel * array.shape(1) : array.strides(0);
  return cv::Mat(rule.size, type, const_cast<void*>(array.data()), static_cast<std::size_t>(step));
}

template <class T>
bool holds(const py::array& array) {
  return py::isinstance<py::array_t<T>>(array);  // in the machine's byte order
}

[[noreturn]] void refuse_type(const py::array& array, const ImageRule& rule) {
  throw py::type_error(wrong(rule.name, rule.expected(), describe(array)));
}

/// A header over a mask; True of bools is 1.
cv::Mat mask_header(const py::object& object, const ImageRule& rule) {
  const py::array array = array_of(object, rule);
  if (!holds<std::uint8_t>(array) && (rule.output || !holds<bool>(array))) refuse_type(array, rule);
  return header(array, CV_8U, rule);
}

/// Grey values of floats as they are recorded.
cv::Mat rounded(const cv::Mat& image, const char* name) {
  double low = 0, high = 0;
  cv::Mat finite = image == image;  // not NaN
  cv::minMaxLoc(image, &low, &high, nullptr, nullptr, finite);
  if (cv::countNonZero(finite) != image.rows * image.cols || low < 0 || high > 255)
    throw py::value_error(
        fmt::format("{}: expected grey values from 0 to 255, got {}", name,
                    low < 0 || high > 255 ? fmt::format("{:g} to {:g}", low, high) : "NaN"));
  if (high > 0 && high <= 1)
    throw py::value_error(fmt::format(
        "{}: expected grey values from 0 to 255, got {:g} to {:g} (multiply by 255)", name, low, high));
  cv::Mat grey;
  image.convertTo(grey, CV_8U);
  return grey;
}

/// Numbers as numpy reads them.
py::array_t<double, py::array::c_style | py::array::forcecast> numbers(const py::object& object,
                                                                       const char* name,
                                                                       const std::string& expected) {
  const auto array = py::array::ensure(object);
  if (!array || std::strchr("fiu", array.dtype().kind()) == nullptr)
    throw py::type_error(wrong(name, expected, array ? describe(array) : describe(object)));
  return array;
}

}  // namespace

cv::Mat colour_image(const py::object& object, const char* name, cv::Size size) {
  const ImageRule rule{name, "uint8", size, true};
  const py::array array = array_of(object, rule);
  if (!holds<std::uint8_t>(array)) refuse_type(array, rule);
  return header(array, CV_8U, rule);
}

cv::Mat depth_image(const py::object& object, const char* name, cv::Size size) {
  const ImageRule rule{name, "float32 (metres) or uint16 (the camera's units)", size};
  const py::array array = array_of(object, rule);
  if (holds<float>(array)) return header(array, CV_32F, rule);
  if (!holds<std::uint16_t>(array)) refuse_type(array, rule);
  return header(array, CV_16U, rule);
}

cv::Mat optional_mask(const py::object& object, const char* name, cv::Size size) {
  if (object.is_none()) return {};
  const cv::Mat mask = mask_header(object, {name, "uint8 or bool", size});
  return holds<bool>(py::reinterpret_borrow<py::array>(object)) ? cv::Mat(mask != 0) : mask;
}

cv::Mat output_mask(const py::object& object, const char* name, cv::Size size) {
  return mask_header(object, {name, "uint8", size, false, true});
}

cv::Mat gray_image(const py::object& object, const char* name, cv::Size size) {
  const ImageRule rule{name, "uint8, float32 or float64", size};
  const py::array array = array_of(object, rule);
  if (holds<std::uint8_t>(array)) return header(array, CV_8U, rule);
  if (holds<float>(array)) return rounded(header(array, CV_32F, rule), name);
  if (holds<double>(array)) return rounded(header(array, CV_64F, rule), name);
  refuse_type(array, rule);
}

cv::Mat metric_depth(const py::object& object, const char* name, const runtime::CameraConfig& camera) {
  const cv::Mat depth = depth_image(object, name, {camera.width, camera.height});
  return depth.type() == CV_16UC1 ? runtime::depth_in_metres(depth, camera) : depth;
}

SE3<double> rigid_motion(const py::object& matrix, const char* name) {
  const std::string expected = "a rigid motion (4, 4)";
  const auto array = numbers(matrix, name, expected);
  const auto refuse = [&](const std::string& got) { throw py::value_error(wrong(name, expected, got)); };
  if (array.ndim() != 2 || array.shape(0) != 4 || array.shape(1) != 4) refuse(describe(array));
  using Matrix4 = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;
  const Matrix4 T = Eigen::Map<const Matrix4>(array.data());
  if (!T.allFinite()) refuse("numbers that are not finite");
  if (!T.row(3).isApprox(Eigen::RowVector4d(0, 0, 0, 1), 1e-6)) refuse("a last row that is not 0 0 0 1");
  const Eigen::Matrix3d R = T.topLeftCorner<3, 3>();
  if (!(R * R.transpose()).isApprox(Eigen::Matrix3d::Identity(), 1e-3) || R.determinant() < 0)
    refuse("an upper left part that is no rotation");
  return SE3<double>(Eigen::Quaterniond(R).normalized(), T.topRightCorner<3, 1>());
}

Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> number_rows(const py::object& object,
                                                                                   const char* name,
                                                                                   int columns, bool finite) {
  const std::string expected = fmt::format("numbers (N, {})", columns);
  const auto array = numbers(object, name, expected);
  if (array.ndim() != 2 || array.shape(1) != columns)
    throw py::value_error(wrong(name, expected, describe(array)));
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Rows rows = Eigen::Map<const Rows>(array.data(), array.shape(0), columns);
  if (finite && !rows.allFinite())
    throw py::value_error(wrong(name, expected, "numbers that are not finite"));
  return rows;
}

Eigen::Vector3d point(const py::object& object, const char* name) {
  const auto array = numbers(object, name, "3 numbers");
  if (array.ndim() != 1 || array.shape(0) != 3)
    throw py::value_error(wrong(name, "3 numbers", describe(array)));
  const Eigen::Vector3d p(array.at(0), array.at(1), array.at(2));
  if (!p.allFinite()) throw py::value_error(wrong(name, "3 finite numbers", "NaN or infinity"));
  return p;
}

double finite(double value, const char* name) {
  if (!std::isfinite(value)) throw py::value_error(wrong(name, "a finite number", fmt::format("{}", value)));
  return value;
}

py::array_t<double> to_array(const SE3<double>& T) {
  py::array_t<double> result({4, 4});
  Eigen::Map<Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(result.mutable_data()) = T.matrix();
  return result;
}

py::array_t<std::uint8_t> to_array(const Image<std::uint8_t>& image) {
  return py::array_t<std::uint8_t>({image.height(), image.width()}, image.data());
}

py::array_t<std::uint8_t> mask_array(const cv::Mat& mask) {
  py::array_t<std::uint8_t> result({mask.rows, mask.cols});
  mask.copyTo(cv::Mat(mask.size(), CV_8UC1, result.mutable_data()));
  return result;
}

py::array image_array(const cv::Mat& image) {
  auto kept = std::make_unique<cv::Mat>(image);  // another reference to the same memory
  const py::capsule owner(kept.get(), [](void* p) { delete static_cast<cv::Mat*>(p); });
  const cv::Mat& m = *kept.release();
  const py::dtype dtype = m.depth() == CV_32F   ? py::dtype::of<float>()
                          : m.depth() == CV_16U ? py::dtype::of<std::uint16_t>()
                                                : py::dtype::of<std::uint8_t>();
  std::vector<py::ssize_t> shape{m.rows, m.cols},
      strides{static_cast<py::ssize_t>(m.step[0]), static_cast<py::ssize_t>(m.elemSize())};
  if (m.channels() > 1) {
    shape.push_back(m.channels());
    strides.push_back(static_cast<py::ssize_t>(m.elemSize1()));
  }
  py::array result(dtype, shape, strides, m.data, owner);
  result.attr("flags").attr("writeable") = false;
  return result;
}

}  // namespace dynslam::python
