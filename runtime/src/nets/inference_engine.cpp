// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/nets/inference_engine.hpp"

#include <array>
#include <fstream>
#include <utility>

#include "dynslam/runtime/error.hpp"
#include "nets/onnx_header.hpp"

namespace dynslam::runtime {

std::optional<EngineKind> parse_engine(std::string_view name) {
  if (name == "auto") return EngineKind::automatic;
  if (name == "onnxruntime") return EngineKind::onnxruntime;
  if (name == "opencv") return EngineKind::opencv;
  return std::nullopt;
}

std::string element_type_name(int type) {
  constexpr std::array<std::string_view, 17> kNames{
      "unknown", "float",   "uint8",  "int8",   "uint16", "int16",   "int32",      "int64",   "string",
      "bool",    "float16", "double", "uint32", "uint64", "complex", "complex128", "bfloat16"};
  const auto known = type > 0 && type < static_cast<int>(kNames.size());
  return std::string(known ? kNames[static_cast<std::size_t>(type)] : "unknown");
}

bool is_whole_type(int type) {
  constexpr int kUint8 = 2, kInt64 = 7, kBool = 9, kUint32 = 12, kUint64 = 13;
  return (type >= kUint8 && type <= kInt64) || type == kBool || type == kUint32 || type == kUint64;
}

namespace {

/// What people have under the name of a model in place of one.
void check_beginning(const std::filesystem::path& model) {
  std::ifstream in(model, std::ios::binary);
  std::string start(32, '\0');
  in.read(start.data(), static_cast<std::streamsize>(start.size()));
  constexpr std::array<std::pair<std::string_view, std::string_view>, 4> kOthers{
      {{"version https://git-lfs", "is the pointer that Git LFS leaves in place of a file: `git lfs pull`"},
       {"<", "is a web page, not a model: was the download refused?"},
       {"PK\x03\x04", "is a zip file, as PyTorch's .pt: export the model to ONNX"},
       {"\x89HDF", "is an HDF5 file, as Keras': export the model to ONNX"}}};
  for (const auto& [beginning, reason] : kOthers) {
    if (start.starts_with(beginning)) throw InputError(model.string(), 0, std::string(reason));
  }
}

}  // namespace

bool has_onnxruntime() {
#ifdef DYNSLAM_HAVE_ONNXRUNTIME
  return true;
#else
  return false;
#endif
}

std::unique_ptr<InferenceEngine> load_engine(const std::filesystem::path& model,
                                             const EngineOptions& options) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(model, error)) throw InputError(model.string(), 0, "is not a file");
  if (std::filesystem::file_size(model, error) == 0) throw InputError(model.string(), 0, "is empty");
  check_beginning(model);
  check_external_files(model);
  EngineKind kind = options.kind;
  if (kind == EngineKind::automatic) kind = has_onnxruntime() ? EngineKind::onnxruntime : EngineKind::opencv;
  if (kind == EngineKind::opencv) return make_opencv_engine(model);
#ifdef DYNSLAM_HAVE_ONNXRUNTIME
  return make_onnxruntime_engine(model, options);
#else
  throw UsageError(
      "--engine onnxruntime: this build has no ONNX Runtime; run scripts/install-onnxruntime.sh and build "
      "again");
#endif
}

}  // namespace dynslam::runtime
