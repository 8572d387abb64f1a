// SPDX-License-Identifier: BSD-3-Clause
// How the mask files of a folder are read.
#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "dynslam/runtime/io/class_meanings.hpp"
#include "dynslam/runtime/io/mask_reader.hpp"
#include "io/mask_image.hpp"

namespace dynslam::runtime {

/// Names of the classes that MaskOptions::labels gives, by their number; empty: it gives none.
/// @throws UsageError where it means nothing
[[nodiscard]] std::vector<std::string> mask_class_names(const MaskOptions& options);

/// One rule for all files of a folder, found by several of them.
class MaskRule {
 public:
  /// Looks at files of the folder that have this size.
  /// @throws InputError where no rule fits them; UsageError for options that mean nothing
  MaskRule(std::filesystem::path folder, const MaskOptions& options, cv::Size size);

  /// @param path  of the file, for messages @throws InputError for values that the rule does not know
  [[nodiscard]] Masks apply(const MaskImage& image, const std::filesystem::path& path) const;
  /// Whether the values of a palette are wanted as they are.
  [[nodiscard]] bool by_index() const { return named_; }
  [[nodiscard]] const std::string& describe() const { return text_; }

 private:
  enum class How { unknown, above, one_value, labels, instances };
  struct Survey;

  void name_classes();
  [[nodiscard]] Survey look(cv::Size size) const;
  void decide(const Survey& survey);
  void decide_grey(const Survey& survey);
  void decide_indexed(const Survey& survey);
  void decide_deep(const Survey& survey);
  void describe(const Survey& survey);
  [[nodiscard]] double dynamic_share(const Survey& survey) const;
  [[nodiscard]] bool is_dynamic(int value) const;

  std::filesystem::path folder_;
  MaskOptions options_;
  How how_ = How::unknown;
  MaskStorage storage_ = MaskStorage::grey;
  int value_ = 0;                             // above: from here on; one_value: this one
  bool named_ = false;                        // by MaskOptions::labels
  std::array<ClassMeaning, 256> meanings_{};  // labels: of each value
  std::string reason_, text_;
};

}  // namespace dynslam::runtime
