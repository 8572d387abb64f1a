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
  std::map<std::string, std::string> makers;  ///< name of the layer that makes an output, where it has one
};

/// Files that the model takes weights from (external data), as it names them: of initializers, of attributes
/// of layers, of functions, at any depth. @throws InputError where the file cannot be read
[[nodiscard]] std::vector<std::string> external_files(const std::filesystem::path& file);

/// Refuses a model that names weights outside its own folder: another person's model would read any file.
/// @throws InputError naming both
void check_external_files(const std::filesystem::path& file);

/// Reads it without an ONNX library: OpenCV's dnn tells neither sizes nor metadata. Parts that are
/// damaged are left out; whether the file is a network is the engine's to judge.
[[nodiscard]] OnnxHeader read_onnx_header(const std::filesystem::path& file);

}  // namespace dynslam::runtime
