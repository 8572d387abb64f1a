// SPDX-License-Identifier: BSD-3-Clause
#include "io/bag/ros2_recording.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <string_view>
#include <utility>

#include "dynslam/runtime/error.hpp"
#include "io/bag/bag_chunk.hpp"
#include "io/bag/db3_file.hpp"
#include "io/bag/mcap_file.hpp"
#include "io/bag/ros2_folder.hpp"
#include "io/bag/zst_file.hpp"

namespace dynslam::runtime::bag {
namespace {

namespace fs = std::filesystem;

enum class Container { none, mcap, db3 };

Container container_of(std::string_view start) {
  constexpr std::string_view kAnyMcap = kMcapMagic.substr(0, 5), kDatabase = "SQLite format 3";
  if (start.starts_with(kAnyMcap)) return Container::mcap;
  return start.starts_with(kDatabase) ? Container::db3 : Container::none;
}

Container container_of(const fs::path& path) {
  constexpr std::size_t kEnough = 16;
  if (is_zst(path)) {
    if (can_decompress("zstd")) return container_of(std::string_view(start_of_zst(path, kEnough)));
    return path.string().find(".mcap.zst") != std::string::npos  ? Container::mcap
           : path.string().find(".db3.zst") != std::string::npos ? Container::db3
                                                                 : Container::none;
  }
  std::error_code error;
  if (!fs::is_regular_file(path, error)) return Container::none;
  std::array<char, kEnough> start{};
  std::ifstream(path, std::ios::binary).read(start.data(), start.size());
  return container_of(std::string_view(start.data(), start.size()));
}

std::unique_ptr<Recording> open_container(Container kind, const fs::path& file, const std::string& name) {
  if (kind == Container::db3) return std::make_unique<Db3File>(file, name);
  return std::make_unique<McapFile>(std::make_unique<FileBytes>(file, name));
}

/// @param missing  gets a line where the file ends too early
std::unique_ptr<Recording> open_part(const fs::path& path, std::vector<std::string>& missing) {
  const Container kind = container_of(path);
  const std::string name = path.string();
  if (kind == Container::none)
    throw InputError(name, 0, "is no recording of ROS 2: neither MCAP nor a database of SQLite");
  if (!is_zst(path)) return open_container(kind, path, name);
  const UnpackedZst unpacked(path);
  if (unpacked.cut_off()) missing.push_back(name + ": was cut off: what could be decompressed is read");
  return open_container(kind, unpacked.path(), name);  // which needs no name of the file any longer
}

/// What a frame of zstd begins with.
constexpr std::array<std::uint8_t, 4> kZstd{0x28, 0xB5, 0x2F, 0xFD};

class Ros2Recording : public Recording {
 public:
  Ros2Recording(std::string name, std::vector<std::unique_ptr<Recording>> parts,
                std::vector<std::string> missing)
      : name_(std::move(name)), parts_(std::move(parts)), missing_(std::move(missing)) {}

  [[nodiscard]] const std::string& name() const override { return name_; }

  std::vector<std::string> scan(const Visit& visit) const override {
    std::vector<std::string> missing = missing_;
    for (std::size_t i = 0; i < parts_.size(); ++i) {
      const auto more = parts_[i]->scan([&](const Connection& connection, Place place) {
        place.part = static_cast<std::uint32_t>(i);
        visit(connection, place);
      });
      missing.insert(missing.end(), more.begin(), more.end());
    }
    return missing;
  }

  [[nodiscard]] std::vector<std::uint8_t> read(const Place& place, std::uint32_t most) const override {
    const Recording& part = *parts_.at(place.part);
    std::vector<std::uint8_t> bytes = part.read(place, most);
    // No message of CDR begins like this.
    if (bytes.size() < kZstd.size() || !std::equal(kZstd.begin(), kZstd.end(), bytes.begin())) return bytes;
    return decompress_zstd(part.read(place), most, where(place, "a message"));
  }

  [[nodiscard]] std::string where(const Place& place, const std::string& topic) const override {
    return parts_.at(place.part)->where(place, topic);
  }

 private:
  std::string name_;
  std::vector<std::unique_ptr<Recording>> parts_;
  std::vector<std::string> missing_;
};

}  // namespace

bool is_ros2(const fs::path& path) {
  std::error_code error;
  return fs::is_directory(path, error) ? is_ros2_folder(path) : container_of(path) != Container::none;
}

std::shared_ptr<const Recording> open_ros2(const fs::path& path) {
  std::vector<std::string> missing;
  std::vector<std::unique_ptr<Recording>> parts;
  if (!fs::is_directory(path)) {
    parts.push_back(open_part(path, missing));
  } else {
    for (const fs::path& file : files_of_ros2(path, missing)) parts.push_back(open_part(file, missing));
  }
  return std::make_shared<const Ros2Recording>(path.string(), std::move(parts), std::move(missing));
}

std::shared_ptr<const Recording> open_ros2(std::unique_ptr<Recording> file) {
  std::string name = file->name();
  std::vector<std::unique_ptr<Recording>> parts;
  parts.push_back(std::move(file));
  return std::make_shared<const Ros2Recording>(std::move(name), std::move(parts), std::vector<std::string>());
}

}  // namespace dynslam::runtime::bag
