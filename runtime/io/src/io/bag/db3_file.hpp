// SPDX-License-Identifier: BSD-3-Clause
// The SQLite databases of rosbag2: tables `topics` and `messages`.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "io/bag/recording.hpp"

struct sqlite3;
struct sqlite3_stmt;

namespace dynslam::runtime::bag {

class Db3File : public Recording {
 public:
  /// Reads the topics; nothing is written, not beside the file either unless a journal (-wal) is there.
  /// @param name  for messages @throws InputError: no database of rosbag2, damaged, or dynslam was built
  /// without SQLite
  Db3File(const std::filesystem::path& file, std::string name);
  /// Of a database in memory.
  Db3File(std::vector<std::uint8_t> content, std::string name);
  [[nodiscard]] const std::string& name() const override { return name_; }
  std::vector<std::string> scan(const Visit& visit) const override;
  [[nodiscard]] std::vector<std::uint8_t> read(const Place& place, std::uint32_t most = ~0U) const override;
  [[nodiscard]] std::string where(const Place& place, const std::string& topic) const override;

 private:
  struct Close {
    void operator()(sqlite3* database) const;
  };
  struct Finalize {
    void operator()(sqlite3_stmt* statement) const;
  };
  using Statement = std::unique_ptr<sqlite3_stmt, Finalize>;

  void open(const std::string& uri);
  /// Whether it could be read with the journal (-wal) beside it.
  [[nodiscard]] bool opens_with_journal(const std::filesystem::path& file);
  void read_topics();
  [[noreturn]] void fail(const std::string& reason) const;
  [[noreturn]] void fail_by_database() const;
  [[nodiscard]] Statement prepare(const char* query) const;
  /// Whether there is another row.
  [[nodiscard]] bool step(sqlite3_stmt* statement) const;
  struct Row {
    std::int64_t id = 0;
    const Connection* topic = nullptr;
    Place place;
  };
  /// The next message behind `row`; false: there is none.
  [[nodiscard]] bool next(sqlite3_stmt* rows, Row& row) const;
  [[nodiscard]] std::vector<std::uint8_t> read_row(const Place& place, std::uint32_t at,
                                                   std::uint32_t size) const;

  std::string name_;
  std::vector<std::uint8_t> content_;  // of one in memory
  std::uint64_t size_ = 0;             // bytes
  std::vector<std::string> missing_;
  bool cut_off_ = false;  // fewer pages than its head says
  std::map<std::int64_t, Connection> topics_;
  std::unique_ptr<sqlite3, Close> database_;
  mutable std::mutex mutex_;
};

/// Whether this build reads databases.
[[nodiscard]] bool can_read_db3();

}  // namespace dynslam::runtime::bag
