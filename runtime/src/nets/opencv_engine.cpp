// SPDX-License-Identifier: BSD-3-Clause
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/dnn.hpp>
#include <utility>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/nets/inference_engine.hpp"
#include "nets/onnx_header.hpp"

namespace dynslam::runtime {
namespace {

std::string reason(const cv::Exception& e) {
  std::string text = e.err.empty() ? std::string(e.what()) : e.err;
  const auto end = text.find('\n');
  if (end != std::string::npos) text.resize(end);
  return text;
}

/// OpenCV prints its own account of what it refuses; one line from us is enough.
class Quiet {
 public:
  Quiet() : level_(cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT)) {}
  ~Quiet() { cv::utils::logging::setLogLevel(level_); }
  Quiet(const Quiet&) = delete;
  Quiet& operator=(const Quiet&) = delete;

 private:
  cv::utils::logging::LogLevel level_;
};

class OpenCvEngine final : public InferenceEngine {
 public:
  explicit OpenCvEngine(const std::filesystem::path& model) : file_(model.string()) {
    const Quiet quiet;
    try {
      net_ = cv::dnn::readNetFromONNX(file_);
    } catch (const cv::Exception& e) {
      throw InputError(file_, 0, "cannot be loaded by OpenCV " CV_VERSION ": " + reason(e));
    }
    net_.setPreferableBackend(cv::dnn::DNN_BACKEND_OPENCV);
    net_.setPreferableTarget(cv::dnn::DNN_TARGET_CPU);
    OnnxHeader header = read_onnx_header(model);
    find_outputs(header);
    inputs_ = std::move(header.inputs);
    metadata_ = std::move(header.metadata);
  }

  void run(std::span<const float> input, std::span<const std::int64_t> shape,
           std::vector<Tensor>& outputs) override {
    std::vector<int> sizes(shape.begin(), shape.end());
    const cv::Mat blob(static_cast<int>(sizes.size()), sizes.data(), CV_32F,
                       const_cast<float*>(input.data()));
    std::vector<cv::Mat> results;
    const Quiet quiet;
    try {
      net_.setInput(blob);
      net_.forward(results, names_);
    } catch (const cv::Exception& e) {
      throw InputError(file_, 0, "cannot be run by OpenCV " CV_VERSION ": " + reason(e));
    }
    outputs.resize(results.size());
    for (std::size_t i = 0; i < results.size(); ++i) {
      cv::Mat values;
      results[i].convertTo(values, CV_32F);
      outputs[i].name = outputs_[i].name;
      outputs[i].whole = is_whole_type(outputs_[i].type);
      outputs[i].shape.assign(values.size.p, values.size.p + values.dims);
      outputs[i].data.assign(values.ptr<float>(), values.ptr<float>() + values.total());
    }
  }

  [[nodiscard]] const std::vector<TensorInfo>& inputs() const override { return inputs_; }
  [[nodiscard]] const std::vector<TensorInfo>& outputs() const override { return outputs_; }
  [[nodiscard]] const std::map<std::string, std::string>& metadata() const override { return metadata_; }
  [[nodiscard]] std::string_view name() const override { return "opencv"; }

 private:
  /// The graph's outputs in its own order and under its own names, where OpenCV has layers that make them: it
  /// calls a layer with a name by that name, others by their output.
  void find_outputs(const OnnxHeader& header) {
    for (const TensorInfo& output : header.outputs) {
      const auto maker = header.makers.find(output.name);
      const std::string layer =
          maker == header.makers.end() || maker->second.empty() ? output.name : "onnx_node!" + maker->second;
      for (const std::string& name : {layer, output.name}) {
        if (net_.getLayerId(name) < 0) continue;
        names_.push_back(name);
        outputs_.push_back(output);
        break;
      }
    }
    if (!names_.empty() && names_.size() == header.outputs.size()) return;
    names_ = net_.getUnconnectedOutLayersNames();
    outputs_.clear();
    for (const auto& name : names_) outputs_.push_back({name, {}, 0});
  }

  std::string file_;
  cv::dnn::Net net_;
  std::vector<cv::String> names_;
  std::vector<TensorInfo> inputs_, outputs_;
  std::map<std::string, std::string> metadata_;
};

}  // namespace

std::unique_ptr<InferenceEngine> make_opencv_engine(const std::filesystem::path& model) {
  return std::make_unique<OpenCvEngine>(model);
}

}  // namespace dynslam::runtime
