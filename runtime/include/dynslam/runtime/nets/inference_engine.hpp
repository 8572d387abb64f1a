// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace dynslam::runtime {

/// A plain array of a network's output; integers and booleans are converted.
struct Tensor {
  std::string name;
  std::vector<std::int64_t> shape;
  std::vector<float> data;  ///< row-major, product of shape values
  bool whole = false;       ///< the network's own type has whole numbers alone (integers, booleans)

  /// Size of dimension `i` counted from the end for negative i; 1 beyond the rank.
  [[nodiscard]] std::int64_t dim(int i) const {
    const int rank = static_cast<int>(shape.size()), k = i < 0 ? rank + i : i;
    return k >= 0 && k < rank ? shape[static_cast<std::size_t>(k)] : 1;
  }
};

/// What a graph says of an input or output; -1: any size.
struct TensorInfo {
  std::string name;
  std::vector<std::int64_t> shape;
  int type = 0;  ///< of its numbers, TensorProto.DataType of onnx.proto; 0: not said
};
/// Name of such a type, "float", "uint8" and the like.
[[nodiscard]] std::string element_type_name(int type);
/// Whether numbers of such a type are whole.
[[nodiscard]] bool is_whole_type(int type);

/// What runs a network.
enum class EngineKind { automatic, onnxruntime, opencv };
/// An engine by its name; empty: there is none of that name.
[[nodiscard]] std::optional<EngineKind> parse_engine(std::string_view name);

/// A network was at work when it was to stop.
struct InferenceStopped : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// How a network is run.
struct EngineOptions {
  EngineKind kind = EngineKind::automatic;
  int threads = 1;
  /// Memory that ONNX Runtime may take for weights and values of all networks of the process [bytes]; the
  /// first network that is loaded sets it. Segmenters need some hundred megabytes; a network that asks for
  /// more than this is mistaken, or its author is not a friend.
  std::size_t memory = std::size_t(4) << 30U;
  const std::atomic<bool>* stop =
      nullptr;  ///< ends a run that does not end when it becomes true; null: nobody
};

/// Runs one network, on the CPU, in this process.
class InferenceEngine {
 public:
  virtual ~InferenceEngine() = default;
  /// Runs the network on one tensor, which is converted where the network takes half precision.
  /// @throws InputError naming the model when the engine refuses, InferenceStopped
  virtual void run(std::span<const float> input, std::span<const std::int64_t> shape,
                   std::vector<Tensor>& outputs) = 0;
  [[nodiscard]] virtual const std::vector<TensorInfo>& inputs() const = 0;
  [[nodiscard]] virtual const std::vector<TensorInfo>& outputs() const = 0;
  /// Key-value pairs that the exporter left in the file.
  [[nodiscard]] virtual const std::map<std::string, std::string>& metadata() const = 0;
  [[nodiscard]] virtual std::string_view name() const = 0;
};

/// Whether this build has ONNX Runtime.
[[nodiscard]] bool has_onnxruntime();

/// Loads a model. `automatic` takes ONNX Runtime, and OpenCV's dnn where the build has none.
/// @throws InputError when the file is missing, damaged or refused; UsageError for an engine this build lacks
[[nodiscard]] std::unique_ptr<InferenceEngine> load_engine(const std::filesystem::path& model,
                                                           const EngineOptions& options = {});

/// ONNX Runtime's; called by load_engine.
[[nodiscard]] std::unique_ptr<InferenceEngine> make_onnxruntime_engine(const std::filesystem::path& model,
                                                                       const EngineOptions& options);
/// That of OpenCV's dnn; called by load_engine.
[[nodiscard]] std::unique_ptr<InferenceEngine> make_opencv_engine(const std::filesystem::path& model);

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
