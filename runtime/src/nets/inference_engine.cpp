// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/nets/inference_engine.hpp"

#include "dynslam/runtime/error.hpp"
#include "nets/onnx_header.hpp"

namespace dynslam::runtime {

std::optional<EngineKind> parse_engine(std::string_view name) {
  if (name == "auto") return EngineKind::automatic;
  if (name == "onnxruntime") return EngineKind::onnxruntime;
  if (name == "opencv") return EngineKind::opencv;
  return std::nullopt;
}

bool has_onnxruntime() {
#ifdef DYNSLAM_HAVE_ONNXRUNTIME
  return true;
#else
  return false;
#endif
}

std::unique_ptr<InferenceEngine> load_engine(const std::filesystem::path& model, EngineKind kind,
                                             int threads) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(model, error)) throw InputError(model.string(), 0, "is not a file");
  if (std::filesystem::file_size(model, error) == 0) throw InputError(model.string(), 0, "is empty");
  check_external_files(model);
  if (kind == EngineKind::automatic) kind = has_onnxruntime() ? EngineKind::onnxruntime : EngineKind::opencv;
  if (kind == EngineKind::opencv) return make_opencv_engine(model);
#ifdef DYNSLAM_HAVE_ONNXRUNTIME
  return make_onnxruntime_engine(model, threads);
#else
  (void)threads;
  throw UsageError(
      "--engine onnxruntime: this build has no ONNX Runtime; run scripts/install-onnxruntime.sh and build "
      "again");
#endif
}

}  // namespace dynslam::runtime
