// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstdint>
#include <filesystem>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

namespace dynslam::runtime {

/// Classes of label images, synthetic sequences and the semantic map.
enum class Label : std::uint8_t { background = 0, person = 1, chair = 2, display = 3 };

/// What a segmenter said of an earlier frame, for the surfaces that later ones show again.
struct EarlierLabels {
  double t = 0;    ///< of that frame [s]
  cv::Mat depth;   ///< CV_32FC1 metres, NaN = invalid
  cv::Mat labels;  ///< CV_8UC1 of Label
};

/// What a segmenter says of one image.
struct Masks {
  cv::Mat dynamic;    ///< CV_8UC1, 255 = dynamic a priori
  cv::Mat labels;     ///< CV_8UC1 of Label; empty where only a mask is known
  cv::Mat instances;  ///< CV_16UC1, 0 = none; empty where unknown
  /// Where the masks were carried here from another frame: its labels. The octree takes what stands still
  /// from them, where the frame was tracked.
  std::shared_ptr<const EarlierLabels> earlier{};
};

/// Which labels are dynamic a priori.
struct MaskOptions {
  std::vector<std::uint8_t> dynamic_labels{static_cast<std::uint8_t>(Label::person)};
};

/// A-priori masks from files named by the colour image's time stamp, `DIR/<stamp>.png`:
/// 8 bit with the values 0 and 255 alone: a dynamic mask, whose connected parts are the instances; other
/// 8-bit values: labels; 16 bit: instances, all of them dynamic. A folder with a subfolder label/ (as
/// synthetic sequences have) is read there.
class MaskSource {
 public:
  /// @throws InputError when the folder does not exist
  explicit MaskSource(std::filesystem::path folder, MaskOptions options = {});

  /// Masks of a frame; nullopt where there is no file (a missed detection, counted).
  /// @throws InputError naming the file: unreadable, wrong type or size
  std::optional<Masks> read(const std::string& stamp, int width, int height);
  [[nodiscard]] std::size_t missing() const { return missing_; }

 private:
  std::filesystem::path folder_;
  MaskOptions options_;
  std::size_t missing_ = 0;
};

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
