// SPDX-License-Identifier: BSD-3-Clause
#ifdef DYNSLAM_HAVE_ONNXRUNTIME
#include <onnxruntime_cxx_api.h>

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <thread>
#include <utility>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/nets/inference_engine.hpp"

namespace dynslam::runtime {
namespace {

/// Ends a run of a network that is at work when it is to stop: ONNX Runtime asks before each node, also
/// within a loop.
class Stopper {
 public:
  explicit Stopper(const std::atomic<bool>* stop) {
    if (stop != nullptr)
      thread_ = std::jthread([this, stop](const std::stop_token& end) { watch(*stop, end); });
  }
  [[nodiscard]] const Ort::RunOptions& options() const { return options_; }
  [[nodiscard]] bool stopped() const { return stopped_; }

 private:
  void watch(const std::atomic<bool>& stop, const std::stop_token& end) {
    constexpr std::chrono::milliseconds kAsk(100);
    std::unique_lock lock(mutex_);
    while (!end.stop_requested() && !stop) waiting_.wait_for(lock, end, kAsk, [] { return false; });
    if (!stop) return;
    stopped_ = true;
    options_.SetTerminate();
  }

  Ort::RunOptions options_;
  std::atomic<bool> stopped_{false};
  std::mutex mutex_;
  std::condition_variable_any waiting_;
  std::jthread thread_;  // last: it uses all of the above
};

/// ONNX Runtime's environment, with one arena of a size from which all networks of the process take their
/// memory.
struct Environment {
  explicit Environment(std::size_t bytes) {
    constexpr int kAsNeeded = 1, kDefault = -1;  // grow by what is asked for, not by powers of two
    const auto memory = Ort::MemoryInfo::CreateCpu(OrtArenaAllocator, OrtMemTypeDefault);
    const Ort::ArenaCfg arena(bytes, kAsNeeded, kDefault, kDefault);
    try {
      ort.CreateAndRegisterAllocator(memory, arena);
    } catch (const Ort::Exception&) {  // the host program has its own environment, with an arena
    }
  }
  Ort::Env ort{ORT_LOGGING_LEVEL_FATAL, "dynslam"};
};

/// The one of all networks that are loaded; the first sets the size. ONNX Runtime's list of allocators has no
/// lock: one thread writes it, before any session reads it.
std::shared_ptr<Environment> shared_environment(std::size_t bytes) {
  static std::mutex mutex;
  static std::weak_ptr<Environment> shared;
  const std::lock_guard lock(mutex);
  auto environment = shared.lock();
  if (!environment) shared = environment = std::make_shared<Environment>(bytes);
  return environment;
}

/// One line of what ONNX Runtime says: its messages run over many.
std::string first_line(std::string text) {
  const auto end = text.find('\n');
  if (end != std::string::npos) text.resize(end);
  return text;
}

/// What ONNX Runtime says, with what is meant where its arena is full.
std::string why(const Ort::Exception& error, std::size_t memory) {
  const std::string text = first_line(error.what());
  if (text.find("vailable memory of") == std::string::npos) return text;
  return fmt::format("it needs more than {} MB of memory, the most that a network gets", memory >> 20U);
}

template <class T>
void convert(const Ort::Value& value, std::size_t count, std::vector<float>& out) {
  const T* data = value.GetTensorData<T>();
  std::transform(data, data + count, out.begin(), [](T x) { return static_cast<float>(x); });
}

void read(const Ort::Value& value, ONNXTensorElementDataType type, std::size_t count, Tensor& out) {
  out.data.resize(count);
  switch (type) {
    case ONNX_TENSOR_ELEMENT_DATA_TYPE_FLOAT:
      return convert<float>(value, count, out.data);
    case ONNX_TENSOR_ELEMENT_DATA_TYPE_DOUBLE:
      return convert<double>(value, count, out.data);
    case ONNX_TENSOR_ELEMENT_DATA_TYPE_FLOAT16:
      return convert<Ort::Float16_t>(value, count, out.data);
    case ONNX_TENSOR_ELEMENT_DATA_TYPE_INT64:
      return convert<std::int64_t>(value, count, out.data);
    case ONNX_TENSOR_ELEMENT_DATA_TYPE_INT32:
      return convert<std::int32_t>(value, count, out.data);
    case ONNX_TENSOR_ELEMENT_DATA_TYPE_INT16:
      return convert<std::int16_t>(value, count, out.data);
    case ONNX_TENSOR_ELEMENT_DATA_TYPE_UINT16:
      return convert<std::uint16_t>(value, count, out.data);
    case ONNX_TENSOR_ELEMENT_DATA_TYPE_INT8:
      return convert<std::int8_t>(value, count, out.data);
    case ONNX_TENSOR_ELEMENT_DATA_TYPE_UINT8:
      return convert<std::uint8_t>(value, count, out.data);
    case ONNX_TENSOR_ELEMENT_DATA_TYPE_BOOL:
      return convert<bool>(value, count, out.data);
    default:  // text and the like: nothing that is decoded
      out.shape.clear();
      out.data.clear();
  }
}

class OnnxRuntimeEngine final : public InferenceEngine {
 public:
  OnnxRuntimeEngine(const std::filesystem::path& model, const EngineOptions& own)
      : file_(model.string()), memory_(own.memory), stopper_(own.stop) {
    Ort::SessionOptions options;
    options.SetIntraOpNumThreads(std::max(1, own.threads));
    options.SetInterOpNumThreads(1);
    options.SetGraphOptimizationLevel(GraphOptimizationLevel::ORT_ENABLE_ALL);
    // Waiting threads sleep: the tracker needs the cores.
    options.AddConfigEntry("session.intra_op.allow_spinning", "0");
    options.AddConfigEntry("session.use_env_allocators", "1");
    try {
      environment_ = shared_environment(memory_);
      session_ = Ort::Session(environment_->ort, model.c_str(), options);
      Ort::AllocatorWithDefaultOptions allocator;
      for (std::size_t i = 0; i < session_.GetInputCount(); ++i) {
        const auto type = session_.GetInputTypeInfo(i);
        if (type.GetONNXType() != ONNX_TYPE_TENSOR)
          throw InputError(file_, 0, "has an input that is no tensor");
        const auto tensor = type.GetTensorTypeAndShapeInfo();
        // The numbers of both enumerations are the same.
        inputs_.push_back({session_.GetInputNameAllocated(i, allocator).get(), tensor.GetShape(),
                           static_cast<int>(tensor.GetElementType())});
      }
      for (std::size_t i = 0; i < session_.GetOutputCount(); ++i) {
        const auto type = session_.GetOutputTypeInfo(i);
        std::vector<std::int64_t> shape;
        int element = 0;
        if (type.GetONNXType() == ONNX_TYPE_TENSOR) {
          shape = type.GetTensorTypeAndShapeInfo().GetShape();
          element = static_cast<int>(type.GetTensorTypeAndShapeInfo().GetElementType());
        }
        outputs_.push_back({session_.GetOutputNameAllocated(i, allocator).get(), std::move(shape), element});
      }
      const Ort::ModelMetadata metadata = session_.GetModelMetadata();
      for (const auto& key : metadata.GetCustomMetadataMapKeysAllocated(allocator)) {
        const auto value = metadata.LookupCustomMetadataMapAllocated(key.get(), allocator);
        metadata_[key.get()] = value ? value.get() : "";
      }
    } catch (const Ort::Exception& e) {
      throw InputError(file_, 0, "cannot be loaded: " + why(e, memory_));
    }
  }

  void run(std::span<const float> input, std::span<const std::int64_t> shape,
           std::vector<Tensor>& outputs) override {
    try {
      const auto memory = Ort::MemoryInfo::CreateCpu(OrtArenaAllocator, OrtMemTypeDefault);
      // The C interface takes a pointer to non-const; the data is not changed.
      const bool half = inputs_.front().type == ONNX_TENSOR_ELEMENT_DATA_TYPE_FLOAT16;
      half_.resize(half ? input.size() : 0);
      if (half)
        std::transform(input.begin(), input.end(), half_.begin(), [](float x) { return Ort::Float16_t(x); });
      const Ort::Value tensor =
          half ? Ort::Value::CreateTensor<Ort::Float16_t>(memory, half_.data(), half_.size(), shape.data(),
                                                          shape.size())
               : Ort::Value::CreateTensor<float>(memory, const_cast<float*>(input.data()), input.size(),
                                                 shape.data(), shape.size());
      const char* input_name = inputs_.front().name.c_str();
      std::vector<const char*> names;
      for (const auto& o : outputs_) names.push_back(o.name.c_str());
      const auto values =
          session_.Run(stopper_.options(), &input_name, &tensor, 1, names.data(), names.size());
      outputs.resize(values.size());
      for (std::size_t i = 0; i < values.size(); ++i) {
        if (!values[i].IsTensor()) {  // a list or a map: nothing that is decoded
          outputs[i] = {outputs_[i].name, {}, {}};
          continue;
        }
        const auto info = values[i].GetTensorTypeAndShapeInfo();
        outputs[i].name = outputs_[i].name;
        outputs[i].shape = info.GetShape();
        outputs[i].whole = is_whole_type(static_cast<int>(info.GetElementType()));
        read(values[i], info.GetElementType(), info.GetElementCount(), outputs[i]);
      }
    } catch (const Ort::Exception& e) {
      if (stopper_.stopped()) throw InferenceStopped(file_ + ": interrupted");
      throw InputError(file_, 0, "cannot be run: " + why(e, memory_));
    }
  }

  [[nodiscard]] const std::vector<TensorInfo>& inputs() const override { return inputs_; }
  [[nodiscard]] const std::vector<TensorInfo>& outputs() const override { return outputs_; }
  [[nodiscard]] const std::map<std::string, std::string>& metadata() const override { return metadata_; }
  [[nodiscard]] std::string_view name() const override { return "onnxruntime"; }

 private:
  std::string file_;
  std::size_t memory_;
  std::shared_ptr<Environment> environment_;
  Ort::Session session_{nullptr};
  std::vector<TensorInfo> inputs_, outputs_;
  std::vector<Ort::Float16_t> half_;  // the input of a network that takes half precision
  std::map<std::string, std::string> metadata_;
  Stopper stopper_;
};

}  // namespace

std::unique_ptr<InferenceEngine> make_onnxruntime_engine(const std::filesystem::path& model,
                                                         const EngineOptions& options) {
  return std::make_unique<OnnxRuntimeEngine>(model, options);
}

}  // namespace dynslam::runtime
#endif
