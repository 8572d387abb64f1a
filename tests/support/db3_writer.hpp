// SPDX-License-Identifier: BSD-3-Clause
// Databases as rosbag2_storage_sqlite3 makes them, by SQLite itself. Only where DYNSLAM_TEST_SQLITE3 is set.
#pragma once

#include <sqlite3.h>

#include <cstdint>
#include <filesystem>
#include <map>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "mcap_writer.hpp"

namespace dynslam::test {

/// Collects messages, in the order in which they were recorded.
class Db3Writer {
 public:
  void add(const std::string& topic, const std::string& type, std::uint64_t t, std::string data) {
    topics_.try_emplace(topic, topics_.size() + 1, type);
    messages_.push_back({topic, t, std::move(data)});
  }
  /// @param prepare  statements before all others, as "PRAGMA page_size = 1024"
  /// @param compression  of each message: zstd, or none
  void write(const std::filesystem::path& file, const std::string& prepare = {},
             const std::string& compression = {}) const {
    sqlite3* database = nullptr;
    sqlite3_open(file.c_str(), &database);
    run(database, prepare);
    // rosbag2, schema version 3.
    run(database,
        "CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL);"
        "CREATE TABLE metadata(id INTEGER PRIMARY KEY, metadata_version INTEGER NOT NULL, metadata TEXT NOT "
        "NULL);"
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, "
        "serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);"
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT "
        "NULL, "
        "data BLOB NOT NULL);"
        "CREATE INDEX timestamp_idx ON messages (timestamp ASC); BEGIN;");
    for (const auto& [name, topic] : topics_)
      run(database, "INSERT INTO topics VALUES(" + std::to_string(topic.first) + ", '" + name + "', '" +
                        ros2_type(topic.second) + "', 'cdr', '')");
    for (const Message& m : messages_) {
      sqlite3_stmt* insert = nullptr;
      sqlite3_prepare_v2(database, "INSERT INTO messages(topic_id, timestamp, data) VALUES(?, ?, ?)", -1,
                         &insert, nullptr);
      const std::string data = compressed_bytes(compression, m.data);
      sqlite3_bind_int64(insert, 1, sqlite3_int64(topics_.at(m.topic).first));
      sqlite3_bind_int64(insert, 2, sqlite3_int64(m.t));
      sqlite3_bind_blob(insert, 3, data.data(), static_cast<int>(data.size()), SQLITE_STATIC);
      if (sqlite3_step(insert) != SQLITE_DONE) throw std::runtime_error(sqlite3_errmsg(database));
      sqlite3_finalize(insert);
    }
    run(database, "COMMIT");
    sqlite3_close(database);
  }

 private:
  struct Message {
    std::string topic;
    std::uint64_t t;
    std::string data;
  };
  static void run(sqlite3* database, const std::string& statements) {
    if (sqlite3_exec(database, statements.c_str(), nullptr, nullptr, nullptr) != SQLITE_OK)
      throw std::runtime_error(sqlite3_errmsg(database));
  }

  std::map<std::string, std::pair<std::uint64_t, std::string>> topics_;
  std::vector<Message> messages_;
};

}  // namespace dynslam::test
