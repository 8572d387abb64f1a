// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "io/file_handle.hpp"

namespace dynslam::runtime::bag {

using Bytes = std::span<const std::uint8_t>;

/// Bytes by their offset; any thread may read.
class ByteSource {
 public:
  ByteSource() = default;
  ByteSource(const ByteSource&) = delete;
  ByteSource& operator=(const ByteSource&) = delete;
  virtual ~ByteSource() = default;
  [[nodiscard]] virtual const std::string& name() const = 0;  ///< for messages
  [[nodiscard]] virtual std::uint64_t size() const = 0;
  /// Fills `out` with what stands from `at` on, all of which is below size(). @throws InputError
  virtual void read(std::uint64_t at, std::span<std::uint8_t> out) const = 0;
};

class FileBytes : public ByteSource {
 public:
  /// @throws InputError
  explicit FileBytes(const std::filesystem::path& path) : FileBytes(path, path.string()) {}
  /// @param name  for messages
  FileBytes(const std::filesystem::path& path, std::string name);
  [[nodiscard]] const std::string& name() const override { return name_; }
  [[nodiscard]] std::uint64_t size() const override { return size_; }
  void read(std::uint64_t at, std::span<std::uint8_t> out) const override;

 private:
  std::string name_;
  FileHandle file_;
  std::uint64_t size_ = 0;
};

class MemoryBytes : public ByteSource {
 public:
  MemoryBytes(std::string name, std::vector<std::uint8_t> bytes)
      : name_(std::move(name)), bytes_(std::move(bytes)) {}
  [[nodiscard]] const std::string& name() const override { return name_; }
  [[nodiscard]] std::uint64_t size() const override { return bytes_.size(); }
  void read(std::uint64_t at, std::span<std::uint8_t> out) const override;

 private:
  std::string name_;
  std::vector<std::uint8_t> bytes_;
};

/// A part of a source, whose offsets begin with it.
class PartOf : public ByteSource {
 public:
  PartOf(const ByteSource& source, std::uint64_t begin, std::uint64_t size, std::string name)
      : source_(source), begin_(begin), size_(size), name_(std::move(name)) {}
  [[nodiscard]] const std::string& name() const override { return name_; }
  [[nodiscard]] std::uint64_t size() const override { return size_; }
  void read(std::uint64_t at, std::span<std::uint8_t> out) const override { source_.read(begin_ + at, out); }

 private:
  const ByteSource& source_;
  std::uint64_t begin_, size_;
  std::string name_;
};

/// Goes through a part of a source, forwards, in windows: what is skipped is not read.
class Cursor {
 public:
  Cursor(const ByteSource& source, std::uint64_t begin, std::uint64_t end);
  [[nodiscard]] const std::string& name() const { return source_.name(); }  ///< the source's
  [[nodiscard]] std::uint64_t at() const { return at_; }
  [[nodiscard]] std::uint64_t left() const { return end_ - at_; }
  /// The next bytes, until the next call. @throws InputError where there are fewer
  Bytes take(std::uint64_t size, const char* what);
  void skip(std::uint64_t size, const char* what);
  /// Little-endian numbers.
  std::uint32_t take_u32(const char* what) { return static_cast<std::uint32_t>(take_number(4, what)); }
  std::uint64_t take_u64(const char* what) { return take_number(8, what); }
  [[noreturn]] void fail(const std::string& reason) const;

 private:
  void need(std::uint64_t size, const char* what) const;
  std::uint64_t take_number(std::uint64_t size, const char* what);

  const ByteSource& source_;
  std::uint64_t at_, end_;
  std::vector<std::uint8_t> window_;
  std::uint64_t window_at_ = 0;
};

}  // namespace dynslam::runtime::bag
