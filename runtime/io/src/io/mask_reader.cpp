// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/io/mask_reader.hpp"

#include <fmt/format.h>

#include <utility>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/image_io.hpp"
#include "io/make_folder.hpp"
#include "io/mask_image.hpp"
#include "io/mask_rule.hpp"

namespace dynslam::runtime {

MaskSource::MaskSource(std::filesystem::path folder, MaskOptions options)
    : folder_(std::move(folder)), options_(std::move(options)) {
  check_is_folder(folder_);
  if (std::filesystem::is_directory(folder_ / "label")) folder_ /= "label";
  (void)mask_class_names(options_);  // before hours are spent
}

MaskSource::~MaskSource() = default;
MaskSource::MaskSource(MaskSource&&) noexcept = default;
MaskSource& MaskSource::operator=(MaskSource&&) noexcept = default;

std::optional<Masks> MaskSource::read(const std::string& stamp, int width, int height) {
  const std::filesystem::path path = folder_ / (stamp + ".png");
  if (!std::filesystem::exists(path)) {
    ++missing_;
    return std::nullopt;
  }
  const EncodedImage file(path);
  if (const cv::Size size = file.size(); size != cv::Size(width, height)) {
    throw InputError(path.string(), 0,
                     fmt::format("is {}x{}, the images are {}x{}", size.width, size.height, width, height));
  }
  if (!rule_) rule_ = std::make_unique<MaskRule>(folder_, options_, cv::Size(width, height));
  Masks masks = rule_->apply(read_mask_image(file, rule_->by_index()), path);
  ++files_;
  marked_ += cv::countNonZero(masks.dynamic) > 0 ? 1 : 0;
  return masks;
}

std::string MaskSource::describe() const {
  return rule_ ? rule_->describe() : std::string();
}

}  // namespace dynslam::runtime
