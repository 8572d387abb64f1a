// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "dynslam/runtime/io/class_meanings.hpp"
#include "dynslam/runtime/io/map_classes.hpp"
#include "dynslam/runtime/masks.hpp"
#include "dynslam/runtime/nets/inference_engine.hpp"
#include "dynslam/runtime/nets/model_output.hpp"
#include "dynslam/runtime/nets/segmentation_decoders.hpp"

namespace dynslam::runtime {

/// Families of networks, by what their outputs mean.
enum class ModelKind { automatic, yolo, mask_rcnn, semantic };
/// A family by its name; empty: there is none of that name.
[[nodiscard]] std::optional<ModelKind> parse_model_kind(std::string_view name);
/// Name of a family.
[[nodiscard]] std::string_view to_string(ModelKind kind);

/// Which network, and how it is run.
struct SegmenterOptions {
  std::filesystem::path model;  ///< .onnx
  EngineKind engine = EngineKind::automatic;
  ModelKind kind = ModelKind::automatic;
  ModelOutput output = ModelOutput::automatic;  ///< what the only channel of a semantic network holds
  std::string output_name;                      ///< of the semantic output; empty: found by name and shape
  int threads = 1;                              ///< of the network; the tracker needs a core of its own
  DetectionOptions detection;
  std::vector<std::string> dynamic_classes{"person"};
  std::vector<std::string>
      map_classes;    ///< for the map; empty: those of chair, tv, tvmonitor, display that the model has
  MapClasses labels;  ///< those that the map has so far; `map_classes` may add to them
  std::size_t memory = EngineOptions().memory;  ///< that the network may take [bytes]
  const std::atomic<bool>* stop = nullptr;      ///< see EngineOptions
  cv::Size input{640, 480};                     ///< where the graph leaves the size open
};

/// A segmentation network in an ONNX file.
class OnnxSegmenter {
 public:
  /// @throws InputError for a file that is no such network, with what it seems to be; UsageError for a class
  /// that it does not have
  explicit OnnxSegmenter(const SegmenterOptions& options);

  /// Masks of one image (CV_8UC3, BGR), of the image's size. Not to be called by two threads at once.
  /// @throws InputError where the network's values are not what its kind has
  [[nodiscard]] Masks segment(const cv::Mat& bgr);

  [[nodiscard]] ModelKind kind() const { return kind_; }
  [[nodiscard]] const std::vector<std::string>& classes() const { return classes_; }
  [[nodiscard]] std::string_view engine() const { return engine_->name(); }
  /// What was recognised, in a line: kind, outputs, what their values are, which classes are used for what.
  [[nodiscard]] std::string describe() const;

 private:
  void recognise();
  void find_classes();
  void fill_input(const cv::Mat& bgr);
  void run(const cv::Mat& bgr);
  [[nodiscard]] Masks decode(cv::Size image);
  [[nodiscard]] Masks decode_classes(cv::Size image);
  [[nodiscard]] const Tensor& output(std::size_t role) const { return outputs_[roles_[role]]; }

  SegmenterOptions options_;
  std::unique_ptr<InferenceEngine> engine_;
  ModelKind kind_ = ModelKind::automatic;
  std::vector<std::string> classes_;  // by the index the network uses; empty names have no class
  std::size_t named_ = 0;             // of them, by the file; 0: they are of a built-in list
  std::string names_from_;            // for the user
  std::int64_t channels_ = 0;         // of a semantic network
  std::vector<ClassMeaning> meanings_;
  std::array<std::size_t, 4> roles_{};   // places of the outputs that are decoded, see ModelOutputs
  std::optional<ChannelReader> reader_;  // of a network with one channel
  std::vector<std::int64_t> shape_;      // of the input
  Letterbox fit_;
  std::vector<float> input_;
  std::vector<Tensor> outputs_;
};

/// Names of the classes in a list as exporters leave it, {0: 'person', 1: 'bicycle'}; empty if it is none.
[[nodiscard]] std::vector<std::string> parse_class_names(const std::string& text);

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
