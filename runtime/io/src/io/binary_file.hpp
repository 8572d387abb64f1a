// SPDX-License-Identifier: BSD-3-Clause
// Versioned binary files with a check sum: magic line, version, size and FNV-1a hash of what follows.
#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "dynslam/geometry/se3.hpp"
#include "dynslam/runtime/error.hpp"

namespace dynslam::runtime {

static_assert(std::endian::native == std::endian::little,
              "the files are little-endian, and so is every supported target");

class BinaryWriter {
 public:
  template <class T>
    requires std::is_arithmetic_v<T>
  void put(T value) { bytes_.append(reinterpret_cast<const char*>(&value), sizeof value); }
  /// Length, then the elements as they are in memory.
  template <class T>
    requires std::is_trivially_copyable_v<T>
  void put(const std::vector<T>& values) {
    put(static_cast<std::uint64_t>(values.size()));
    if (!values.empty())
      bytes_.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
  }
  void put(const Eigen::Vector3d& v) {
    for (int i = 0; i < 3; ++i) put(v(i));
  }
  void put(const SE3<double>& T) {
    for (int i = 0; i < 4; ++i) put(T.so3().quaternion().coeffs()(i));
    put(T.translation());
  }
  void put(std::string_view text) {
    put(static_cast<std::uint64_t>(text.size()));
    bytes_.append(text);
  }
  /// Without their number.
  void put_bytes(std::string_view bytes) { bytes_.append(bytes); }
  [[nodiscard]] const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

/// Reads what BinaryWriter wrote; whatever does not fit is an InputError that names the file.
class BinaryReader {
 public:
  /// @param at  where the content begins in `bytes`
  BinaryReader(std::string bytes, std::filesystem::path path, std::size_t at = 0, std::uint32_t version = 0,
               std::uint64_t hash = 0)
      : bytes_(std::move(bytes)), path_(std::move(path)), at_(at), version_(version), hash_(hash) {}

  [[nodiscard]] std::uint32_t version() const { return version_; }
  /// Check sum of the content.
  [[nodiscard]] std::uint64_t hash() const { return hash_; }

  template <class T>
  [[nodiscard]] T get() {
    if constexpr (std::is_same_v<T, Eigen::Vector3d>) {
      Eigen::Vector3d v;
      for (int i = 0; i < 3; ++i) v(i) = get<double>();
      require(v.allFinite(), "holds numbers that are not finite");
      return v;
    } else if constexpr (std::is_same_v<T, SE3<double>>) {
      Eigen::Quaterniond q;
      for (int i = 0; i < 4; ++i) q.coeffs()(i) = get<double>();
      require(std::abs(q.norm() - 1) < 1e-6, "holds a rotation that is none");
      const auto t = get<Eigen::Vector3d>();
      return SE3<double>(SO3<double>::from_unit(q), t);
    } else if constexpr (std::is_same_v<T, std::string>) {
      const std::size_t n = count(1);
      std::string text = bytes_.substr(at_, n);
      at_ += n;
      return text;
    } else {
      static_assert(std::is_arithmetic_v<T>);
      require(bytes_.size() - at_ >= sizeof(T), "is truncated");
      T value;
      std::memcpy(&value, bytes_.data() + at_, sizeof value);
      at_ += sizeof value;
      return value;
    }
  }
  template <class T>
    requires std::is_trivially_copyable_v<T>
  void get(std::vector<T>& values) {
    values.resize(count(sizeof(T)));
    if (!values.empty()) std::memcpy(values.data(), bytes_.data() + at_, values.size() * sizeof(T));
    at_ += values.size() * sizeof(T);
  }
  /// A number of things that take at least `size` bytes each.
  [[nodiscard]] std::size_t count(std::size_t size) {
    const auto n = get<std::uint64_t>();
    require(n <= (bytes_.size() - at_) / size, "is truncated");
    return static_cast<std::size_t>(n);
  }
  void finish() const { require(at_ == bytes_.size(), "is longer than what it holds"); }
  /// What is not read yet.
  [[nodiscard]] std::string_view rest() const { return std::string_view(bytes_).substr(at_); }
  void require(bool condition, const char* reason) const {
    if (!condition) throw InputError(path_.string(), 0, reason);
  }

 private:
  std::string bytes_;
  std::filesystem::path path_;
  std::size_t at_ = 0;
  std::uint32_t version_ = 0;
  std::uint64_t hash_ = 0;
};

/// @return the content's check sum @throws InputError when the file cannot be written
std::uint64_t write_binary(const std::filesystem::path& path, std::string_view magic, std::uint32_t version,
                           const BinaryWriter& content);
/// @param oldest  version that is read, too
/// @throws InputError naming the file: missing, no regular file, of another kind or version, truncated, or
/// with a wrong check sum
[[nodiscard]] BinaryReader read_binary(const std::filesystem::path& path, std::string_view magic,
                                       std::uint32_t version, std::uint32_t oldest);

}  // namespace dynslam::runtime
