// SPDX-License-Identifier: BSD-3-Clause
#include "io/bag/ros_messages.hpp"

#include <fmt/format.h>

#include <bit>
#include <cmath>

#include "dynslam/runtime/error.hpp"

namespace dynslam::runtime::bag {
namespace {

constexpr const char* kPoseStamped = "geometry_msgs/PoseStamped";
constexpr const char* kTransformStamped = "geometry_msgs/TransformStamped";
constexpr const char* kOdometry = "nav_msgs/Odometry";

/// Takes one value after the other: numbers are little-endian, arrays and texts have their length before
/// them.
class MessageReader {
 public:
  MessageReader(Bytes bytes, const std::string& name) : rest_(bytes), name_(name), size_(bytes.size()) {}

  [[noreturn]] void fail(const std::string& reason) const { throw InputError(name_, 0, reason); }

  Bytes bytes(std::uint64_t size, const char* what) {
    if (size > rest_.size())
      fail(fmt::format("the message ends at byte {}: {} needs {} bytes from byte {} on", size_, what, size,
                       size_ - rest_.size()));
    const Bytes found = rest_.first(static_cast<std::size_t>(size));
    rest_ = rest_.subspan(found.size());
    return found;
  }
  std::uint8_t u8(const char* what) { return bytes(1, what)[0]; }
  std::uint32_t u32(const char* what) { return static_cast<std::uint32_t>(number(4, what)); }
  double f64(const char* what) { return std::bit_cast<double>(number(8, what)); }
  std::string text(const char* what) {
    const Bytes found = bytes(u32(what), what);
    return {reinterpret_cast<const char*>(found.data()), found.size()};
  }
  /// Bytes with their number before them.
  Bytes array(const char* what) { return bytes(u32(what), what); }

  std::string frame(const char* what) {
    std::string found = text(what);
    return found.starts_with('/') ? found.substr(1) : found;
  }
  Header header() {
    Header header;
    (void)u32("the header");  // a counter
    header.seconds = u32("the stamp");
    header.nanoseconds = u32("the stamp");
    if (header.nanoseconds >= 1000000000U)
      fail(fmt::format("the stamp has {} nanoseconds", header.nanoseconds));
    header.frame = frame("the frame");
    return header;
  }
  /// Position (or translation) and quaternion.
  SE3<double> pose() {
    Eigen::Vector3d t;
    for (double& x : t) x = f64("a position");
    Eigen::Quaterniond q;
    for (double& x : q.coeffs()) x = f64("a rotation");    // x y z w, as Eigen keeps them
    constexpr double kFarthest = 1e12, kTolerance = 1e-2;  // metres; of a unit quaternion
    if (!t.allFinite() || t.cwiseAbs().maxCoeff() > kFarthest || !q.coeffs().allFinite() ||
        !(std::abs(q.coeffs().norm() - 1) <= kTolerance))
      fail("a pose that is none: its numbers are not finite or its quaternion is not of length 1");
    return {q.normalized(), t};
  }
  void end() const {
    if (!rest_.empty()) fail(fmt::format("{} bytes are left behind the message", rest_.size()));
  }

 private:
  std::uint64_t number(std::size_t size, const char* what) {
    std::uint64_t value = 0;
    const Bytes found = bytes(size, what);
    for (std::size_t k = 0; k < size; ++k) value |= static_cast<std::uint64_t>(found[k]) << (8 * k);
    return value;
  }

  Bytes rest_;
  const std::string& name_;
  std::size_t size_;
};

void take_head(MessageReader& in, bool compressed, ImageMessage& image) {
  image.header = in.header();
  if (!compressed) {
    image.height = in.u32("the height");
    image.width = in.u32("the width");
  }
  image.encoding = in.text(compressed ? "the format" : "the encoding");
}

PoseMessage take_transform(MessageReader& in) {
  PoseMessage message;
  message.header = in.header();
  message.child = in.frame("the child's frame");
  message.T_parent_child = in.pose();
  return message;
}

PoseMessage take_odometry(MessageReader& in) {
  PoseMessage message;
  message.header = in.header();
  message.child = in.frame("the child's frame");
  message.T_parent_child = in.pose();
  constexpr std::uint64_t kCovariance = 36, kTwist = 6;  // numbers
  (void)in.bytes(8 * (kCovariance + kTwist + kCovariance), "covariances and twist");
  return message;
}

}  // namespace

ImageMessage parse_image_head(Bytes bytes, bool compressed, const std::string& name) {
  MessageReader in(bytes, name);
  ImageMessage image;
  take_head(in, compressed, image);
  return image;
}

ImageMessage parse_image(Bytes bytes, const std::string& name) {
  MessageReader in(bytes, name);
  ImageMessage image;
  take_head(in, false, image);
  image.big_endian = in.u8("is_bigendian") != 0;
  image.step = in.u32("the step");
  image.data = in.array("the image");
  in.end();
  return image;
}

ImageMessage parse_compressed_image(Bytes bytes, const std::string& name) {
  MessageReader in(bytes, name);
  ImageMessage image;
  take_head(in, true, image);
  image.data = in.array("the image");
  in.end();
  return image;
}

CameraInfoMessage parse_camera_info(Bytes bytes, const std::string& name) {
  MessageReader in(bytes, name);
  CameraInfoMessage info;
  info.header = in.header();
  info.height = in.u32("the height");
  info.width = in.u32("the width");
  info.distortion_model = in.text("distortion_model");
  const std::uint32_t coefficients = in.u32("D");
  constexpr std::uint32_t kMost = 64;
  if (coefficients > kMost) in.fail(fmt::format("D has {} numbers", coefficients));
  for (std::uint32_t k = 0; k < coefficients; ++k) info.d.push_back(in.f64("D"));
  for (double& x : info.k) x = in.f64("K");
  for (int k = 0; k < 9; ++k) (void)in.f64("R");
  for (double& x : info.p) x = in.f64("P");
  info.binning_x = in.u32("binning_x");
  info.binning_y = in.u32("binning_y");
  info.roi_x = in.u32("roi");
  info.roi_y = in.u32("roi");
  (void)in.bytes(4 + 4 + 1, "roi");  // height, width, whether it is to be rectified
  in.end();
  return info;
}

bool holds_transforms(const std::string& type) {
  return type == "tf/tfMessage" || type == "tf2_msgs/TFMessage";
}

bool holds_poses(const std::string& type) {
  return holds_transforms(type) || type == kPoseStamped || type == kTransformStamped || type == kOdometry;
}

std::vector<PoseMessage> parse_poses(Bytes bytes, const std::string& type, const std::string& name) {
  MessageReader in(bytes, name);
  std::vector<PoseMessage> poses;
  if (holds_transforms(type)) {
    const std::uint32_t count = in.u32("the transforms");
    for (std::uint32_t k = 0; k < count; ++k) poses.push_back(take_transform(in));
  } else if (type == kTransformStamped) {
    poses.push_back(take_transform(in));
  } else if (type == kOdometry) {
    poses.push_back(take_odometry(in));
  } else if (type == kPoseStamped) {
    PoseMessage message;
    message.header = in.header();
    message.T_parent_child = in.pose();
    poses.push_back(std::move(message));
  } else {
    in.fail("holds no poses");
  }
  in.end();
  return poses;
}

}  // namespace dynslam::runtime::bag
