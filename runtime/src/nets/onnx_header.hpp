// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "dynslam/runtime/nets/inference_engine.hpp"

namespace dynslam::runtime {

/// What an ONNX file says of itself, apart from its layers.
struct OnnxHeader {
  std::vector<TensorInfo> inputs, outputs;
  std::map<std::string, std::string> metadata;
};

/// Reads it without an ONNX library: OpenCV's dnn tells neither sizes nor metadata. Parts that are
/// damaged are left out; whether the file is a network is the engine's to judge.
[[nodiscard]] OnnxHeader read_onnx_header(const std::filesystem::path& file);

}  // namespace dynslam::runtime
