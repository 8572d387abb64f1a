// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "dynslam/runtime/io/map_classes.hpp"
#include "dynslam/runtime/masks.hpp"

namespace dynslam::runtime {

/// What the values of mask files mean.
struct MaskOptions {
  /// Classes of label images, "15=person"; or one word for all: voc, coco or cityscapes (their lists),
  /// instances (each value but 0 is an object), binary (each value but 0 is dynamic). Empty: by looking.
  std::vector<std::string> labels;
  std::vector<std::string> dynamic_classes{"person"};  ///< names of classes that move by themselves
  std::vector<std::string> map_classes;  ///< for the map; empty: chairs and displays, and those of `labels`
  MapClasses map_labels;                 ///< those that the map has so far
};

class MaskRule;

/// A-priori masks from files named by the colour image's time stamp, `DIR/<stamp>.png`. What their values
/// mean is found out once, over several files, and holds for all of the folder (docs/segmentation.md): masks
/// with hard or soft rims, this library's labels (0 to 3), Pascal VOC's by their palette, instances of 16
/// bits, an alpha channel; other labels need MaskOptions::labels. A folder with a subfolder label/ (as
/// synthetic sequences have) is read there.
class MaskSource {
 public:
  /// @throws InputError when the folder does not exist; UsageError for options that mean nothing
  explicit MaskSource(std::filesystem::path folder, MaskOptions options = {});
  ~MaskSource();
  MaskSource(MaskSource&&) noexcept;
  MaskSource& operator=(MaskSource&&) noexcept;

  /// Masks of a frame; nullopt where there is no file (a missed detection, counted).
  /// @throws InputError naming the file: unreadable, wrong size, or with values that mean nothing; naming the
  ///         folder where no rule fits it
  std::optional<Masks> read(const std::string& stamp, int width, int height);
  [[nodiscard]] std::size_t missing() const { return missing_; }
  /// Files read so far, and those of them in which something is dynamic.
  [[nodiscard]] std::size_t files() const { return files_; }
  [[nodiscard]] std::size_t marked() const { return marked_; }
  /// How the files are read and why, in a line; empty before the first.
  [[nodiscard]] std::string describe() const;

 private:
  std::filesystem::path folder_;
  MaskOptions options_;
  std::unique_ptr<MaskRule> rule_;  // null before the first file
  std::size_t missing_ = 0, files_ = 0, marked_ = 0;
};

/// Labels of the map that a run's classes take: those of a network or of mask files.
[[nodiscard]] MapClasses labels_of_masks(const MaskOptions& options);

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
