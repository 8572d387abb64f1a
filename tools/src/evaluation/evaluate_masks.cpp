// SPDX-License-Identifier: BSD-3-Clause
// Masks against the truth, both read as `run` reads masks.
#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/evaluation/evaluate.hpp"
#include "dynslam/runtime/io/image_io.hpp"
#include "io/make_folder.hpp"

namespace dynslam::runtime {
namespace {

namespace fs = std::filesystem;

double ratio(std::size_t a, std::size_t b) {
  return b > 0 ? static_cast<double>(a) / static_cast<double>(b) : 0.0;
}

/// @param shares  of one frame at least
MaskShares shares_of(std::vector<double> shares) {
  std::sort(shares.begin(), shares.end());
  const auto n = static_cast<double>(shares.size());
  return {shares.size(),
          std::accumulate(shares.begin(), shares.end(), 0.0) / n,
          shares[static_cast<std::size_t>(0.95 * (n - 1) + 0.5)],
          shares.back(),
          {}};
}

/// Where MaskSource reads the files of a folder.
fs::path folder_of_masks(const fs::path& folder) {
  return fs::is_directory(folder / "label") ? folder / "label" : folder;
}

/// Stems of the PNG files in a folder, sorted. @throws InputError where there are none
std::vector<std::string> mask_names(const fs::path& folder) {
  check_is_folder(folder);
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder_of_masks(folder))) {
    if (entry.path().extension() == ".png") names.push_back(entry.path().stem().string());
  }
  std::sort(names.begin(), names.end());
  if (names.empty()) throw InputError(folder.string(), 0, "holds no PNG masks");
  return names;
}

cv::Mat dynamic_of(MaskSource& source, const std::string& name, cv::Size size) {
  auto masks = source.read(name, size.width, size.height);
  return masks ? std::move(masks->dynamic) : cv::Mat();
}

}  // namespace

MaskReport evaluate_masks(const fs::path& predicted, const fs::path& truth, int widen,
                          const MaskOptions& options, const MaskOptions& truth_options) {
  check_is_folder(predicted);
  const std::vector<std::string> names = mask_names(truth);
  MaskSource found_masks(predicted, options), true_masks(truth, truth_options);
  MaskReport report;
  std::size_t both = 0, either = 0, in_truth = 0, in_prediction = 0;
  std::vector<double> spill;
  const cv::Mat around = cv::getStructuringElement(cv::MORPH_ELLIPSE, cv::Size(2 * widen + 1, 2 * widen + 1));
  for (const std::string& name : names) {
    const cv::Size size = EncodedImage(folder_of_masks(truth) / (name + ".png")).size();
    const cv::Mat expected = dynamic_of(true_masks, name, size);
    const fs::path file = folder_of_masks(predicted) / (name + ".png");
    if (fs::exists(file) && EncodedImage(file).size() != size)
      throw InputError(file.string(), 0, "and its truth differ in size");
    cv::Mat found = dynamic_of(found_masks, name, size);
    if (found.empty()) {
      ++report.missing;
      found = cv::Mat::zeros(size, CV_8UC1);
    }
    const auto common = static_cast<std::size_t>(cv::countNonZero(found & expected));
    const auto wanted = static_cast<std::size_t>(cv::countNonZero(expected));
    both += common;
    in_truth += wanted;
    in_prediction += static_cast<std::size_t>(cv::countNonZero(found));
    either += static_cast<std::size_t>(cv::countNonZero(found | expected));
    if (wanted > 0 && ratio(common, wanted) < 0.3) ++report.frames_recall_below_0_3;
    cv::Mat near = expected;
    if (widen > 0) cv::dilate(expected, near, around);
    spill.push_back(ratio(static_cast<std::size_t>(cv::countNonZero(found & ~near)), expected.total()));
    ++report.frames;
  }
  if (report.missing == report.frames)
    throw InputError(predicted.string(), 0, "has no mask in common with " + truth.string());
  report.read_as = {found_masks.describe(), true_masks.describe()};
  report.iou = ratio(both, either);
  report.recall = ratio(both, in_truth);
  report.precision = ratio(both, in_prediction);
  report.spill = shares_of(std::move(spill));
  return report;
}

nlohmann::json to_json(const MaskReport& r) {
  return {{"frames", r.frames},
          {"missing", r.missing},
          {"iou", r.iou},
          {"recall", r.recall},
          {"precision", r.precision},
          {"frames_recall_below_0_3", r.frames_recall_below_0_3},
          {"spill", to_json(r.spill)},
          {"read_as", r.read_as}};
}

std::string to_text(const MaskReport& r) {
  return fmt::format(
             "{} frames ({} without a prediction): recall {:.4f}, IoU {:.4f}, precision {:.4f}, {} frames "
             "with "
             "recall below 0.3; beyond the truth {:.2f} % of a frame's pixels, worst {:.2f} %\n",
             r.frames, r.missing, r.recall, r.iou, r.precision, r.frames_recall_below_0_3, 100 * r.spill.mean,
             100 * r.spill.worst) +
         fmt::format("masks: {}\ntruth: {}\n", r.read_as[0], r.read_as[1]);
}

MaskShares mask_shares(const fs::path& folder, const MaskOptions& options) {
  std::vector<double> shares;
  const std::vector<std::string> names = mask_names(folder);
  MaskSource source(folder, options);
  for (const std::string& name : names) {
    const cv::Size size = EncodedImage(folder_of_masks(folder) / (name + ".png")).size();
    const cv::Mat mask = dynamic_of(source, name, size);
    shares.push_back(ratio(static_cast<std::size_t>(cv::countNonZero(mask)), mask.total()));
  }
  MaskShares result = shares_of(std::move(shares));
  result.read_as = source.describe();
  return result;
}

nlohmann::json to_json(const MaskShares& s) {
  nlohmann::json j{{"frames", s.frames}, {"mean", s.mean}, {"p95", s.p95}, {"worst", s.worst}};
  if (!s.read_as.empty()) j["read_as"] = s.read_as;
  return j;
}

std::string to_text(const MaskShares& s) {
  return fmt::format("{} frames: masks cover {:.2f} % of a frame's pixels, p95 {:.2f} %, worst {:.2f} %\n",
                     s.frames, 100 * s.mean, 100 * s.p95, 100 * s.worst) +
         fmt::format("masks: {}\n", s.read_as);
}

}  // namespace dynslam::runtime
