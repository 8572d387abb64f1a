// SPDX-License-Identifier: BSD-3-Clause
#include "io/bag/db3_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>
#include <system_error>
#include <utility>

#include "dynslam/runtime/error.hpp"
#include "io/bag/bag_chunk.hpp"
#ifdef DYNSLAM_HAVE_SQLITE3
#include <sqlite3.h>
#endif

namespace dynslam::runtime::bag {

#ifdef DYNSLAM_HAVE_SQLITE3

namespace {

constexpr const char* kTopics = "SELECT id, name, type, serialization_format FROM topics";
constexpr const char* kMessages =
    "SELECT rowid, topic_id, typeof(data), length(data) FROM messages ORDER BY rowid";

std::string column_text(sqlite3_stmt* row, int column) {
  const auto* text = reinterpret_cast<const char*>(sqlite3_column_text(row, column));
  return text == nullptr ? std::string() : text;
}

/// Of a file as SQLite's URIs have it.
std::string uri_of(const std::filesystem::path& file, bool immutable) {
  std::string uri = "file:";
  for (const char c : std::filesystem::absolute(file).string())
    uri += std::string_view("%?#").find(c) == std::string_view::npos
               ? std::string(1, c)
               : fmt::format("%{:02X}", static_cast<unsigned char>(c));
  return uri + (immutable ? "?immutable=1" : "?mode=ro");
}

/// Pages times their size, as a database's first bytes say; 0: they do not.
std::uint64_t size_by_head(const std::array<std::uint8_t, 32>& head) {
  const std::uint64_t page = 256U * head[16] + head[17];
  std::uint64_t pages = 0;
  for (std::size_t k = 28; k < 32; ++k) pages = pages << 8U | head[k];
  return pages * (page == 1 ? 65536 : page);
}

}  // namespace

bool can_read_db3() {
  return true;
}

void Db3File::Close::operator()(sqlite3* database) const {
  sqlite3_close(database);
}

void Db3File::Finalize::operator()(sqlite3_stmt* statement) const {
  sqlite3_finalize(statement);
}

void Db3File::fail(const std::string& reason) const {
  throw InputError(name_, 0, reason);
}

void Db3File::fail_by_database() const {
  fail(fmt::format("SQLite: {}", sqlite3_errmsg(database_.get())));
}

Db3File::Db3File(const std::filesystem::path& file, std::string name) : name_(std::move(name)) {
  const FileBytes bytes(file, name_);
  size_ = bytes.size();
  std::array<std::uint8_t, 32> head{};
  if (size_ >= head.size()) bytes.read(0, head);
  cut_off_ = size_by_head(head) > size_;
  std::error_code error;
  const std::filesystem::path journal = file.string() + "-wal";
  const auto pending = std::filesystem::file_size(journal, error);
  if (!error && pending > 0 && opens_with_journal(file)) {
    size_ += pending;
    missing_.push_back(
        fmt::format("{}: was not closed; what is in {} is read, too", name_, journal.filename().string()));
    return;
  }
  if (!error && pending > 0)
    missing_.push_back(
        fmt::format("{}: was not closed, and {} cannot be read", name_, journal.filename().string()));
  open(uri_of(file, true));
  if (std::filesystem::exists(file.string() + "-journal", error))
    missing_.push_back(fmt::format("{}: was not closed: messages may be missing", name_));
  read_topics();
}

bool Db3File::opens_with_journal(const std::filesystem::path& file) {
  const bool cut_off = std::exchange(cut_off_, false);  // its last pages may be in the journal
  try {
    open(uri_of(file, false));
    read_topics();
    return true;
  } catch (const InputError&) {
    topics_.clear();
    cut_off_ = cut_off;
    return false;
  }
}

Db3File::Db3File(std::vector<std::uint8_t> content, std::string name)
    : name_(std::move(name)), content_(std::move(content)), size_(content_.size()) {
  std::array<std::uint8_t, 32> head{};
  if (size_ >= head.size()) std::copy_n(content_.begin(), head.size(), head.begin());
  cut_off_ = size_by_head(head) > size_;
  open(":memory:");
  const auto size = static_cast<sqlite3_int64>(content_.size());
  if (sqlite3_deserialize(database_.get(), "main", content_.data(), size, size,
                          SQLITE_DESERIALIZE_READONLY) != SQLITE_OK)
    fail_by_database();
  read_topics();
}

void Db3File::open(const std::string& uri) {
  sqlite3* opened = nullptr;
  const int code = sqlite3_open_v2(uri.c_str(), &opened,
                                   SQLITE_OPEN_READONLY | SQLITE_OPEN_URI | SQLITE_OPEN_NOMUTEX, nullptr);
  database_.reset(opened);
  if (code != SQLITE_OK) fail(fmt::format("SQLite: {}", sqlite3_errstr(code)));
  // A schema may hold expressions; none of an unknown file is evaluated.
  sqlite3_db_config(opened, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
  sqlite3_limit(opened, SQLITE_LIMIT_LENGTH, static_cast<int>(kLargestChunk));
  sqlite3_exec(opened, "PRAGMA cell_size_check = ON", nullptr, nullptr, nullptr);
  // Without this SQLite refuses a database with fewer pages than its head says. Nothing can be written.
  if (cut_off_) sqlite3_exec(opened, "PRAGMA writable_schema = ON", nullptr, nullptr, nullptr);
}

Db3File::Statement Db3File::prepare(const char* query) const {
  sqlite3_stmt* statement = nullptr;
  if (sqlite3_prepare_v2(database_.get(), query, -1, &statement, nullptr) != SQLITE_OK) fail_by_database();
  return Statement(statement);
}

bool Db3File::step(sqlite3_stmt* statement) const {
  const int code = sqlite3_step(statement);
  if (code != SQLITE_ROW && code != SQLITE_DONE) fail_by_database();
  return code == SQLITE_ROW;
}

void Db3File::read_topics() {
  const Statement tables = prepare(
      "SELECT count(*) FROM sqlite_master WHERE name IN ('topics', 'messages') AND sql LIKE 'CREATE TABLE%'");
  if (!step(tables.get()) || sqlite3_column_int(tables.get(), 0) != 2)
    fail("is a database of SQLite, but none of rosbag2: it has no tables 'topics' and 'messages'");
  const Statement rows = prepare(kTopics);
  constexpr std::size_t kMost = 100000;
  while (step(rows.get())) {
    const Connection topic{column_text(rows.get(), 1), plain_type(column_text(rows.get(), 2)),
                           column_text(rows.get(), 3)};
    topics_.emplace(sqlite3_column_int64(rows.get(), 0), topic);
    if (topics_.size() > kMost) fail(fmt::format("has more than {} topics", kMost));
  }
}

std::vector<std::string> Db3File::scan(const Visit& visit) const {
  std::vector<std::string> missing = missing_;
  const Statement rows = prepare(kMessages);
  Row row;
  std::size_t messages = 0;
  const auto another = [&] {
    try {
      return next(rows.get(), row);
    } catch (const InputError&) {
      if (!cut_off_) throw;
      return false;
    }
  };
  for (; another(); ++messages) visit(*row.topic, row.place);
  if (cut_off_) missing.push_back(fmt::format("{}: was cut off: {} messages are read", name_, messages));
  return missing;
}

bool Db3File::next(sqlite3_stmt* rows, Row& row) const {
  const std::lock_guard lock(mutex_);
  if (!step(rows)) return false;
  const std::int64_t id = sqlite3_column_int64(rows, 0), topic = sqlite3_column_int64(rows, 1);
  const std::int64_t size = sqlite3_column_int64(rows, 3);
  // Pages that lead in a circle would give rows without end.
  if (row.topic != nullptr && id <= row.id)
    fail(fmt::format("is damaged: message {} comes behind message {}", id, row.id));
  if (column_text(rows, 2) != "blob") fail(fmt::format("is damaged: message {} holds no bytes", id));
  if (size > static_cast<std::int64_t>(std::min<std::uint64_t>(size_, kLargestChunk)))
    fail(fmt::format("message {} has {} bytes, more than the file or than {}", id, size, kLargestChunk));
  const auto found = topics_.find(topic);
  if (found == topics_.end())
    fail(fmt::format("is damaged: message {} is of the unknown topic {}", id, topic));
  row = {id, &found->second, {static_cast<std::uint64_t>(id), 0, static_cast<std::uint32_t>(size)}};
  if (cut_off_ && size > 0) (void)read_row(row.place, row.place.size - 1, 1);  // is it there to its end?
  return true;
}

std::vector<std::uint8_t> Db3File::read_row(const Place& place, std::uint32_t at, std::uint32_t size) const {
  sqlite3_blob* opened = nullptr;
  const auto id = static_cast<sqlite3_int64>(place.at);
  if (sqlite3_blob_open(database_.get(), "main", "messages", "data", id, 0, &opened) != SQLITE_OK)
    fail_by_database();
  const std::unique_ptr<sqlite3_blob, decltype(&sqlite3_blob_close)> blob(opened, &sqlite3_blob_close);
  std::vector<std::uint8_t> data(size);
  if (size > 0 &&
      sqlite3_blob_read(opened, data.data(), static_cast<int>(size), static_cast<int>(at)) != SQLITE_OK)
    fail_by_database();
  return data;
}

std::vector<std::uint8_t> Db3File::read(const Place& place, std::uint32_t most) const {
  const std::lock_guard lock(mutex_);
  return read_row(place, 0, std::min(place.size, most));
}

#else

bool can_read_db3() {
  return false;
}
void Db3File::Close::operator()(sqlite3*) const {}
void Db3File::Finalize::operator()(sqlite3_stmt*) const {}
Db3File::Db3File(const std::filesystem::path&, std::string name)
    : Db3File(std::vector<std::uint8_t>(), std::move(name)) {}
Db3File::Db3File(std::vector<std::uint8_t>, std::string name) : name_(std::move(name)) {
  throw InputError(name_, 0,
                   "is a database of SQLite, which this dynslam was built without: build it where "
                   "libsqlite3-dev is installed, or convert the recording to MCAP (ros2 bag convert)");
}
std::vector<std::string> Db3File::scan(const Visit&) const {
  return {};
}
std::vector<std::uint8_t> Db3File::read(const Place&, std::uint32_t) const {
  return {};
}

#endif

std::string Db3File::where(const Place& place, const std::string& topic) const {
  return fmt::format("{}: {}, message {}", name_, topic, static_cast<std::int64_t>(place.at));
}

}  // namespace dynslam::runtime::bag
