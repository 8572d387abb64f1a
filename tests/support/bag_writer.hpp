// SPDX-License-Identifier: BSD-3-Clause
// ROS messages and bags of format 2.0, written by the description of the format. Where librosbag-storage is
// installed, tests have it read and rewrite them.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <map>
#include <opencv2/core.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "dynslam/geometry/se3.hpp"

namespace dynslam::test {

/// Little-endian numbers, texts with their length before them.
class Serialised {
 public:
  Serialised& number(std::uint64_t value, int size) {
    for (int k = 0; k < size; ++k) bytes_ += static_cast<char>(value >> (8 * k) & 0xFF);
    return *this;
  }
  Serialised& u32(std::uint64_t value) { return number(value, 4); }
  Serialised& f64(double value) { return number(std::bit_cast<std::uint64_t>(value), 8); }
  Serialised& raw(std::string_view text) {
    bytes_ += text;
    return *this;
  }
  Serialised& text(std::string_view text) { return u32(text.size()).raw(text); }
  /// A stamp of so many nanoseconds, as seconds and the rest.
  Serialised& time(std::uint64_t nanoseconds) {
    return u32(nanoseconds / 1000000000U).u32(nanoseconds % 1000000000U);
  }
  Serialised& header(std::uint64_t nanoseconds, std::string_view frame) {
    return u32(7).time(nanoseconds).text(frame);
  }
  Serialised& pose(const SE3<double>& T) {
    for (const double x : T.translation()) f64(x);
    for (const double x : T.so3().quaternion().coeffs()) f64(x);
    return *this;
  }
  [[nodiscard]] const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

inline std::string pixels_of(const cv::Mat& image) {
  const cv::Mat whole = image.isContinuous() ? image : image.clone();
  return {reinterpret_cast<const char*>(whole.data), whole.total() * whole.elemSize()};
}

inline std::string image_message(std::uint64_t t, std::string_view frame, std::string_view encoding,
                                 const cv::Mat& image) {
  return Serialised()
      .header(t, frame)
      .u32(static_cast<std::uint32_t>(image.rows))
      .u32(static_cast<std::uint32_t>(image.cols))
      .text(encoding)
      .number(0, 1)
      .u32(static_cast<std::size_t>(image.cols) * image.elemSize())
      .text(pixels_of(image))
      .bytes();
}

inline std::string compressed_message(std::uint64_t t, std::string_view frame, std::string_view format,
                                      const std::string& data) {
  return Serialised().header(t, frame).text(format).text(data).bytes();
}

struct InfoOfCamera {
  int width = 640, height = 480;
  std::array<double, 4> k{535.4, 539.2, 320.1, 247.6};  ///< fx, fy, cx, cy
  std::string model = "plumb_bob";
  std::vector<double> d{0, 0, 0, 0, 0};
  std::array<double, 4> p{535.4, 539.2, 320.1, 247.6};  ///< of the rectified image
  std::uint32_t binning = 0;
};

inline std::string info_message(std::uint64_t t, std::string_view frame, const InfoOfCamera& camera) {
  Serialised s;
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
inline std::string tf_message(std::uint64_t t, const std::vector<TransformOf>& transforms) {
  Serialised s;
  s.u32(transforms.size());
  for (const TransformOf& x : transforms) s.header(t, x.parent).text(x.child).pose(x.T);
  return s.bytes();
}

inline std::string pose_message(std::uint64_t t, std::string_view frame, const SE3<double>& T) {
  return Serialised().header(t, frame).pose(T).bytes();
}

inline std::string odometry_message(std::uint64_t t, std::string_view child, const SE3<double>& T) {
  return Serialised().header(t, "odom").text(child).pose(T).raw(std::string((36 + 6 + 36) * 8, '\0')).bytes();
}

/// Collects messages, in the order in which they were recorded.
class BagWriter {
 public:
  void add(const std::string& topic, const std::string& type, std::uint64_t t, std::string data) {
    const auto [found, is_new] = connections_.try_emplace(topic, connections_.size(), type);
    messages_.push_back({found->second.first, t, std::move(data), is_new ? topic : std::string()});
  }

  /// The bag, a chunk for each `per_chunk` messages.
  [[nodiscard]] std::string bytes(std::size_t per_chunk = 4) const {
    std::string bag = "#ROSBAG V2.0\n";
    const std::size_t header_at = bag.size();
    bag += bag_header(0, 0);
    std::string infos;
    std::size_t chunks = 0;
    for (std::size_t i = 0; i < messages_.size(); i += per_chunk, ++chunks)
      add_chunk(i, std::min(i + per_chunk, messages_.size()), bag, infos);
    const std::size_t index = bag.size();
    for (const auto& [topic, connection] : connections_) bag += connection_record(topic);
    bag.replace(header_at, bag_header(0, 0).size(), bag_header(index, chunks));
    return bag + infos;
  }

 private:
  struct Message {
    std::uint64_t connection, t;
    std::string data, introduces;  ///< the topic whose first message this is
  };
  using Fields = std::vector<std::pair<std::string, std::string>>;

  static std::string number(std::uint64_t value, int size) {
    return Serialised().number(value, size).bytes();
  }
  static std::string header(const Fields& fields) {
    Serialised s;
    for (const auto& [name, value] : fields) s.text(name + "=" + value);
    return s.bytes();
  }
  static std::string record(const Fields& fields, const std::string& data) {
    return Serialised().text(header(fields)).text(data).bytes();
  }
  [[nodiscard]] std::string bag_header(std::uint64_t index, std::uint64_t chunks) const {
    const std::string fields = header({{"op", number(3, 1)},
                                       {"index_pos", number(index, 8)},
                                       {"conn_count", number(connections_.size(), 4)},
                                       {"chunk_count", number(chunks, 4)}});
    return Serialised().text(fields).text(std::string(4096 - fields.size() - 8, ' ')).bytes();
  }
  [[nodiscard]] std::string connection_record(const std::string& topic) const {
    const auto& [id, type] = connections_.at(topic);
    return record({{"op", number(7, 1)}, {"conn", number(id, 4)}, {"topic", topic}},
                  header({{"topic", topic},
                          {"type", type},
                          {"md5sum", "0123456789abcdef0123456789abcdef"},
                          {"message_definition", "# none"}}));
  }
  void add_chunk(std::size_t begin, std::size_t end, std::string& bag, std::string& infos) const {
    std::string data;
    std::map<std::uint64_t, std::string> index;  // by connection: time and offset of its messages
    for (std::size_t i = begin; i < end; ++i) {
      const Message& m = messages_[i];
      if (!m.introduces.empty()) data += connection_record(m.introduces);
      index[m.connection] += Serialised().time(m.t).u32(data.size()).bytes();
      data += record(
          {{"op", number(2, 1)}, {"conn", number(m.connection, 4)}, {"time", Serialised().time(m.t).bytes()}},
          m.data);
    }
    std::string counts;
    for (const auto& [connection, entries] : index)
      counts += number(connection, 4) + number(entries.size() / 12, 4);
    infos += record({{"op", number(6, 1)},
                     {"ver", number(1, 4)},
                     {"chunk_pos", number(bag.size(), 8)},
                     {"start_time", Serialised().time(messages_[begin].t).bytes()},
                     {"end_time", Serialised().time(messages_[end - 1].t).bytes()},
                     {"count", number(index.size(), 4)}},
                    counts);
    bag += record({{"op", number(5, 1)}, {"compression", "none"}, {"size", number(data.size(), 4)}}, data);
    for (const auto& [connection, entries] : index)
      bag += record({{"op", number(4, 1)},
                     {"ver", number(1, 4)},
                     {"conn", number(connection, 4)},
                     {"count", number(entries.size() / 12, 4)}},
                    entries);
  }

  std::map<std::string, std::pair<std::uint64_t, std::string>> connections_;
  std::vector<Message> messages_;
};

}  // namespace dynslam::test
