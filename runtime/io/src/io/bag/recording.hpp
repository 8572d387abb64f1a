// SPDX-License-Identifier: BSD-3-Clause
// What every container of ROS messages offers: ROS 1 bags, MCAP files, SQLite databases, and several of them.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace dynslam::runtime::bag {

/// One publisher of a topic.
struct Connection {
  std::string topic, type;        ///< /camera/rgb/image_color, sensor_msgs/Image
  std::string encoding = "ros1";  ///< of its messages: ros1, cdr, or one that is not read
  bool operator==(const Connection&) const = default;
};

/// Where a message's data lie.
struct Place {
  std::uint64_t at = 0;     ///< offset; a database's row
  std::uint64_t chunk = 0;  ///< offset of the chunk's record in the file, `at` is in the chunk; 0: in none
  std::uint32_t size = 0;
  std::uint32_t part = 0;  ///< of a recording in several files
};

class Recording {
 public:
  using Visit = std::function<void(const Connection&, const Place&)>;

  Recording() = default;
  Recording(const Recording&) = delete;
  Recording& operator=(const Recording&) = delete;
  virtual ~Recording() = default;
  [[nodiscard]] virtual const std::string& name() const = 0;  ///< for messages
  /// Calls `visit` for every message, in the order of the file.
  /// @return what is missing of the recording, a line each @throws InputError
  virtual std::vector<std::string> scan(const Visit& visit) const = 0;
  /// The first bytes of a message's data, at most `most`. Any thread may ask. @throws InputError
  [[nodiscard]] virtual std::vector<std::uint8_t> read(const Place& place,
                                                       std::uint32_t most = ~0U) const = 0;
  /// The file, and where in it the message is, for messages.
  [[nodiscard]] virtual std::string where(const Place& place, const std::string& topic) const = 0;
};

/// A type as ROS 1 names it: sensor_msgs/Image for ROS 2's sensor_msgs/msg/Image.
[[nodiscard]] std::string plain_type(const std::string& type);

/// "FILE: TOPIC, message at byte AT of the chunk at byte CHUNK"
[[nodiscard]] std::string where_in_file(const std::string& file, const std::string& topic,
                                        const Place& place);

}  // namespace dynslam::runtime::bag
