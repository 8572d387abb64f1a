// SPDX-License-Identifier: BSD-3-Clause
// Bags of format 2.0, written by the description of the format. Where librosbag-storage is installed, tests
// have it read and rewrite them.
#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "ros_message_writer.hpp"

namespace dynslam::test {

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
