// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/io/sequence.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <set>
#include <sstream>
#include <system_error>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/read_file.hpp"
#include "dynslam/runtime/io/text_lines.hpp"
#include "io/camera_facts.hpp"
#include "io/formats/format.hpp"
#include "io/make_folder.hpp"

namespace dynslam::runtime {
namespace {

namespace fs = std::filesystem;
using formats::Format;

constexpr std::array<const Format*, 12> kFormats{
    &formats::kTum,         &formats::kBonn,         &formats::kEth3d,   &formats::kIclNuim,
    &formats::kSevenScenes, &formats::kReplica,      &formats::kScanNet, &formats::kRedwood,
    &formats::kTartanAir,   &formats::kStrayScanner, &formats::kBag,     &formats::kRos2};

/// Those that may be a file.
constexpr std::array<const Format*, 2> kRecordings{&formats::kBag, &formats::kRos2};

std::string names() {
  std::string text;
  for (const Format* format : kFormats) text += fmt::format("{}{}", text.empty() ? "" : "|", format->name);
  return text;
}

/// The first names in a folder, for a message.
std::string contents(const fs::path& root) {
  std::vector<std::string> found;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(root, error))
    found.push_back(entry.path().filename().string() + (entry.is_directory(error) ? "/" : ""));
  std::sort(found.begin(), found.end());
  constexpr std::size_t kShown = 6;
  std::string text;
  for (std::size_t i = 0; i < std::min(kShown, found.size()); ++i)
    text += fmt::format("{}{}", i > 0 ? ", " : "", found[i]);
  if (found.size() > kShown) text += fmt::format(" and {} more", found.size() - kShown);
  return found.empty() ? "nothing" : text;
}

/// What the folders that may hold images have, for a message.
std::string image_folders(const fs::path& root) {
  std::string text;
  for (const char* name : {"color", "image", "rgb", "depth"}) {
    if (fs::is_directory(root / name))
      text +=
          fmt::format("{} {}/ holds {}", text.empty() ? ". Of images," : ";", name, contents(root / name));
  }
  return text;
}

const Format& format_by_name(const std::string& name) {
  const auto found =
      std::find_if(kFormats.begin(), kFormats.end(), [&](const Format* f) { return f->name == name; });
  if (found == kFormats.end()) throw UsageError(fmt::format("unknown format '{}': {}", name, names()));
  return **found;
}

const Format& format_by_looking(const fs::path& root) {
  std::vector<const Format*> matching;
  for (const Format* format : kFormats) {
    if (format->matches(root)) matching.push_back(format);
  }
  if (matching.size() == 1) return *matching.front();
  if (matching.empty())
    throw InputError(root.string(), 0,
                     fmt::format("is of no known format; it holds {}. Each format's files are in "
                                 "docs/your-own-data.md; --format {} names one{}",
                                 contents(root), names(), image_folders(root)));
  std::string found;
  for (const Format* format : matching)
    found += fmt::format("{}{} ({})", found.empty() ? "" : " and of ", format->name, format->files);
  throw InputError(root.string(), 0,
                   fmt::format("has the files of {}: say which is meant with --format NAME", found));
}

const Format& format_of(const fs::path& root, const std::string& name) {
  const bool folder = fs::is_directory(root);
  for (const Format* recording : kRecordings) {
    if (name == recording->name) return *recording;  // which says itself what is none
  }
  if (!folder && name.empty() && fs::exists(root)) {
    for (const Format* recording : kRecordings) {
      if (recording->matches(root)) return *recording;
    }
    throw InputError(root.string(), 0,
                     fs::is_regular_file(root) && fs::file_size(root) == 0
                         ? "is empty"
                         : "is neither a folder nor a recording of ROS (.bag, .mcap, .db3)");
  }
  check_is_folder(root);
  return name.empty() ? format_by_looking(root) : format_by_name(name);
}

}  // namespace

std::vector<SequenceFormat> sequence_formats() {
  std::vector<SequenceFormat> all;
  for (const Format* format : kFormats) all.push_back({format->name, format->files});
  return all;
}

std::vector<std::string> formats_of(const fs::path& root) {
  std::vector<std::string> found;
  for (const Format* format : kFormats) {
    if (format->matches(root)) found.emplace_back(format->name);
  }
  return found;
}

Sequence load_sequence(const fs::path& root, const SequenceOptions& options) {
  if (!(options.rate > 0 && options.rate <= 1e6))
    throw UsageError(fmt::format("a rate of {} frames per second is none", options.rate));
  if (has_control(root.string()))
    throw InputError(root.string(), 0,
                     "has a control character in its name, which no list of names can hold");
  std::error_code error;
  if (fs::exists(root / kUnfinished, error))
    throw InputError(
        root.string(), 0,
        fmt::format("is not whole ({}): the command that makes it was interrupted, and begins it "
                    "anew when called again, or is still at work",
                    kUnfinished));
  const Format& format = format_of(root, options.format);
  const bool recording = std::find(kRecordings.begin(), kRecordings.end(), &format) != kRecordings.end();
  if (!options.topics.empty() && !recording)
    throw UsageError(fmt::format("--topics is for bags; {} is of the format {}", root.string(), format.name));
  Sequence sequence = format.load(root, options);
  sequence.format = std::string(format.name);
  if (!recording && !sequence.float_depth) formats::judge_float_depth(sequence, sequence.root.string());
  if (sequence.groundtruth.empty()) sequence.truth_file.clear();
  if (const fs::path file = camera_file_in(root); !file.empty()) sequence.camera_hint = file.string();
  if (options.max_frames > 0 && sequence.frames.size() > options.max_frames)
    sequence.frames.resize(options.max_frames);
  return sequence;
}

void check_no_input(const Sequence& sequence, const fs::path& folder) {
  std::set<fs::path> inputs{sequence.root / "dynamic_mask"};
  for (const FrameRecord& frame : sequence.frames) {
    if (frame.source) continue;
    inputs.insert(fs::path(frame.rgb).parent_path());
    inputs.insert(fs::path(frame.depth).parent_path());
  }
  std::error_code error;
  for (const fs::path& input : inputs) {
    if (fs::equivalent(input, folder, error))
      throw UsageError(folder.string() +
                       " holds images of the sequence: name another folder for the results");
  }
}

CameraConfig camera_of(const Sequence& sequence, const std::string& name_or_file) {
  const std::string& named = name_or_file.empty() ? sequence.camera_hint : name_or_file;
  if (named.empty() && sequence.camera) return *sequence.camera;
  CameraConfig camera;
  if (formats::is_eth3d_camera(named)) {
    std::istringstream in(read_text(named));
    camera = formats::parse_eth3d_camera(in, formats::first_size(sequence.frames, false), named);
    if (sequence.depth_units > 0) camera.depth_units_per_metre = sequence.depth_units;
  } else {
    camera = sequence.depth_units > 0 ? load_camera(named, sequence.depth_units) : load_camera(named);
  }
  if (camera.invalid_depth == 0 && sequence.camera) camera.invalid_depth = sequence.camera->invalid_depth;
  return camera;
}

}  // namespace dynslam::runtime
