// SPDX-License-Identifier: BSD-3-Clause
// ROS messages, written by the descriptions of their serialisations: that of ROS 1, and CDR as OMG has it
// (formal/21-11-03, DDS-XTypes 7.4), in both byte orders.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <opencv2/core.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "dynslam/geometry/se3.hpp"

namespace dynslam::test {

enum class Wire { ros1, cdr_little, cdr_big };

/// Numbers, texts with their length before them; in CDR numbers at multiples of their size, texts with a
/// zero.
class Serialised {
 public:
  explicit Serialised(Wire wire = Wire::ros1) : wire_(wire) {
    if (wire_ != Wire::ros1) bytes_ = {'\0', wire_ == Wire::cdr_little ? '\1' : '\0', '\0', '\0'};
  }
  Serialised& number(std::uint64_t value, int size) {
    while (wire_ != Wire::ros1 && (bytes_.size() - 4) % static_cast<std::size_t>(size) != 0) bytes_ += '\0';
    for (int k = 0; k < size; ++k) {
      const int shift = 8 * (wire_ == Wire::cdr_big ? size - 1 - k : k);
      bytes_ += static_cast<char>(value >> shift & 0xFF);
    }
    return *this;
  }
  Serialised& u32(std::uint64_t value) { return number(value, 4); }
  Serialised& f64(double value) { return number(std::bit_cast<std::uint64_t>(value), 8); }
  Serialised& raw(std::string_view text) {
    bytes_ += text;
    return *this;
  }
  Serialised& text(std::string_view text) {
    if (wire_ == Wire::ros1) return array(text);
    return u32(text.size() + 1).raw(text).raw(std::string_view("\0", 1));
  }
  /// Bytes, with their number before them.
  Serialised& array(std::string_view bytes) { return u32(bytes.size()).raw(bytes); }
  /// A stamp of so many nanoseconds, as seconds and the rest.
  Serialised& time(std::uint64_t nanoseconds) {
    return u32(nanoseconds / 1000000000U).u32(nanoseconds % 1000000000U);
  }
  Serialised& header(std::uint64_t nanoseconds, std::string_view frame) {
    if (wire_ == Wire::ros1) u32(7);
    return time(nanoseconds).text(frame);
  }
  Serialised& pose(const SE3<double>& T) {
    for (const double x : T.translation()) f64(x);
    for (const double x : T.so3().quaternion().coeffs()) f64(x);
    return *this;
  }
  [[nodiscard]] const std::string& bytes() const { return bytes_; }

 private:
  Wire wire_;
  std::string bytes_;
};

inline std::string pixels_of(const cv::Mat& image) {
  const cv::Mat whole = image.isContinuous() ? image : image.clone();
  return {reinterpret_cast<const char*>(whole.data), whole.total() * whole.elemSize()};
}

inline std::string image_message(std::uint64_t t, std::string_view frame, std::string_view encoding,
                                 const cv::Mat& image, Wire wire = Wire::ros1) {
  return Serialised(wire)
      .header(t, frame)
      .u32(static_cast<std::uint32_t>(image.rows))
      .u32(static_cast<std::uint32_t>(image.cols))
      .text(encoding)
      .number(0, 1)
      .u32(static_cast<std::size_t>(image.cols) * image.elemSize())
      .array(pixels_of(image))
      .bytes();
}

inline std::string compressed_message(std::uint64_t t, std::string_view frame, std::string_view format,
                                      const std::string& data, Wire wire = Wire::ros1) {
  return Serialised(wire).header(t, frame).text(format).array(data).bytes();
}

struct InfoOfCamera {
  int width = 640, height = 480;
  std::array<double, 4> k{535.4, 539.2, 320.1, 247.6};  ///< fx, fy, cx, cy
  std::string model = "plumb_bob";
  std::vector<double> d{0, 0, 0, 0, 0};
  std::array<double, 4> p{535.4, 539.2, 320.1, 247.6};  ///< of the rectified image
  std::uint32_t binning = 0;
};

inline std::string info_message(std::uint64_t t, std::string_view frame, const InfoOfCamera& camera,
                                Wire wire = Wire::ros1) {
  Serialised s(wire);
  s.header(t, frame).u32(std::uint64_t(camera.height)).u32(std::uint64_t(camera.width)).text(camera.model);
  s.u32(camera.d.size());
  for (const double x : camera.d) s.f64(x);
  const auto& k = camera.k;
  for (const double x : {k[0], 0.0, k[2], 0.0, k[1], k[3], 0.0, 0.0, 1.0}) s.f64(x);
  for (const double x : {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0}) s.f64(x);
  const auto& p = camera.p;
  for (const double x : {p[0], 0.0, p[2], 0.0, 0.0, p[1], p[3], 0.0, 0.0, 0.0, 1.0, 0.0}) s.f64(x);
  s.u32(camera.binning).u32(camera.binning).u32(0).u32(0).u32(0).u32(0).number(0, 1);
  return s.bytes();
}

struct TransformOf {
  std::string parent, child;
  SE3<double> T;
};
inline std::string tf_message(std::uint64_t t, const std::vector<TransformOf>& transforms,
                              Wire wire = Wire::ros1) {
  Serialised s(wire);
  s.u32(transforms.size());
  for (const TransformOf& x : transforms) s.header(t, x.parent).text(x.child).pose(x.T);
  return s.bytes();
}

inline std::string pose_message(std::uint64_t t, std::string_view frame, const SE3<double>& T,
                                Wire wire = Wire::ros1) {
  return Serialised(wire).header(t, frame).pose(T).bytes();
}

inline std::string odometry_message(std::uint64_t t, std::string_view child, const SE3<double>& T,
                                    Wire wire = Wire::ros1) {
  return Serialised(wire)
      .header(t, "odom")
      .text(child)
      .pose(T)
      .raw(std::string((36 + 6 + 36) * 8, '\0'))
      .bytes();
}

}  // namespace dynslam::test
