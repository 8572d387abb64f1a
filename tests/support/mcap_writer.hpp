// SPDX-License-Identifier: BSD-3-Clause
// MCAP files of version 0, written by the description of the format (https://mcap.dev/spec). Where npm is
// there, tests compare with files by npm's @mcap/core.
#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>
#ifdef DYNSLAM_TEST_LZ4
#include <lz4frame.h>
#endif
#ifdef DYNSLAM_TEST_ZSTD
#include <zstd.h>
#endif

#include "ros_message_writer.hpp"

namespace dynslam::test {

/// What this build of the tests compresses with.
inline std::vector<std::string> mcap_compressions() {
  std::vector<std::string> all{""};
#ifdef DYNSLAM_TEST_LZ4
  all.emplace_back("lz4");
#endif
#ifdef DYNSLAM_TEST_ZSTD
  all.emplace_back("zstd");
#endif
  return all;
}

inline std::string compressed_bytes([[maybe_unused]] const std::string& compression,
                                    const std::string& bytes) {
#ifdef DYNSLAM_TEST_LZ4
  if (compression == "lz4") {
    std::string packed(LZ4F_compressFrameBound(bytes.size(), nullptr), '\0');
    packed.resize(LZ4F_compressFrame(packed.data(), packed.size(), bytes.data(), bytes.size(), nullptr));
    return packed;
  }
#endif
#ifdef DYNSLAM_TEST_ZSTD
  if (compression == "zstd") {
    std::string packed(ZSTD_compressBound(bytes.size()), '\0');
    packed.resize(ZSTD_compress(packed.data(), packed.size(), bytes.data(), bytes.size(), 3));
    return packed;
  }
#endif
  return bytes;
}

/// As ROS 2 names the types of messages.
inline std::string ros2_type(const std::string& type) {
  if (type == "tf/tfMessage") return "tf2_msgs/msg/TFMessage";
  const auto slash = type.find('/');
  return type.substr(0, slash) + "/msg" + type.substr(slash);
}

/// How an MCAP file is written.
struct McapLayout {
  std::size_t per_chunk = 4;  ///< messages; 0: no chunks
  std::string compression;    ///< lz4 or zstd
  bool index = true, crc = true;
  std::string encoding = "cdr";
};

/// Collects messages, in the order in which they were recorded.
class McapWriter {
 public:
  void add(const std::string& topic, const std::string& type, std::uint64_t t, std::string data) {
    const auto [found, is_new] = channels_.try_emplace(topic, channels_.size() + 1, type);
    messages_.push_back({found->second.first, t, std::move(data), is_new ? topic : std::string()});
  }

  [[nodiscard]] std::string bytes(const McapLayout& layout = {}) const {
    const std::string magic("\x89MCAP0\r\n", 8);
    std::string file = magic + record(1, Serialised().text("ros2").text("test"));
    std::string indexes;
    const std::size_t step = std::max<std::size_t>(layout.per_chunk, 1);
    for (std::size_t i = 0; i < messages_.size(); i += step)
      add_chunk(i, std::min(i + step, messages_.size()), layout, file, indexes);
    file += record(15, Serialised().u32(0));  // end of data, without a check sum
    const std::size_t summary = layout.index ? file.size() : 0;
    if (layout.index) {
      for (const auto& [topic, channel] : channels_) file += channel_records(topic, layout);
      file += statistics() + indexes;
    }
    return file + record(2, Serialised().number(summary, 8).number(0, 8).u32(0)) + magic;
  }

 private:
  struct Message {
    std::uint64_t channel, t;
    std::string data, introduces;  ///< the topic whose first message this is
  };

  static std::string record(int op, const Serialised& content) {
    return Serialised()
        .number(std::uint64_t(op), 1)
        .number(content.bytes().size(), 8)
        .raw(content.bytes())
        .bytes();
  }
  static std::uint64_t check_sum(const std::string& bytes) {
    std::uint32_t crc = ~0U;
    for (const char c : bytes) {
      crc ^= static_cast<unsigned char>(c);
      for (int k = 0; k < 8; ++k) crc = crc >> 1U ^ ((crc & 1U) != 0 ? 0xEDB88320U : 0U);
    }
    return ~crc;
  }
  [[nodiscard]] std::string channel_records(const std::string& topic, const McapLayout& layout) const {
    const auto& [id, type] = channels_.at(topic);
    const std::string name = layout.encoding == "cdr" ? ros2_type(type) : type;
    return record(3, Serialised().number(id, 2).text(name).text("ros2msg").text("# none")) +
           record(4, Serialised().number(id, 2).number(id, 2).text(topic).text(layout.encoding).u32(0));
  }
  [[nodiscard]] std::string statistics() const {
    std::map<std::uint64_t, std::uint64_t> counts;
    for (const Message& m : messages_) ++counts[m.channel];
    Serialised map;
    for (const auto& [channel, count] : counts) map.number(channel, 2).number(count, 8);
    return record(11, Serialised()
                          .number(messages_.size(), 8)
                          .number(counts.size(), 2)
                          .u32(counts.size())
                          .u32(0)
                          .u32(0)
                          .u32(0)
                          .number(0, 8)
                          .number(0, 8)
                          .text(map.bytes()));
  }
  void add_chunk(std::size_t begin, std::size_t end, const McapLayout& layout, std::string& file,
                 std::string& indexes) const {
    std::string data;
    std::map<std::uint64_t, std::string> index;  // by channel: time and offset of its messages
    for (std::size_t i = begin; i < end; ++i) {
      const Message& m = messages_[i];
      if (!m.introduces.empty()) data += channel_records(m.introduces, layout);
      index[m.channel] += Serialised().number(m.t, 8).number(data.size(), 8).bytes();
      data += record(5, Serialised().number(m.channel, 2).u32(i).number(m.t, 8).number(m.t, 8).raw(m.data));
    }
    if (layout.per_chunk == 0) {
      file += data;
      return;
    }
    const std::uint64_t t0 = messages_[begin].t, t1 = messages_[end - 1].t, at = file.size();
    const std::string packed = compressed_bytes(layout.compression, data);
    file += record(6, Serialised()
                          .number(t0, 8)
                          .number(t1, 8)
                          .number(data.size(), 8)
                          .u32(layout.crc ? check_sum(data) : 0)
                          .text(layout.compression)
                          .number(packed.size(), 8)
                          .raw(packed));
    const std::uint64_t length = file.size() - at, indexes_at = file.size();
    Serialised offsets;
    for (const auto& [channel, entries] : index) {
      offsets.number(channel, 2).number(file.size(), 8);
      file += record(7, Serialised().number(channel, 2).text(entries));
    }
    indexes += record(8, Serialised()
                             .number(t0, 8)
                             .number(t1, 8)
                             .number(at, 8)
                             .number(length, 8)
                             .text(offsets.bytes())
                             .number(file.size() - indexes_at, 8)
                             .text(layout.compression)
                             .number(packed.size(), 8)
                             .number(data.size(), 8));
  }

  std::map<std::string, std::pair<std::uint64_t, std::string>> channels_;
  std::vector<Message> messages_;
};

}  // namespace dynslam::test
