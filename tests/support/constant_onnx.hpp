// SPDX-License-Identifier: BSD-3-Clause
// Writes ONNX files with any inputs and outputs, whose answers do not depend on the image.
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include "tiny_onnx.hpp"

namespace dynslam::test {

/// Types of onnx.proto.
inline constexpr int kOnnxFloat = 1, kOnnxUint8 = 2, kOnnxInt64 = 7, kOnnxHalf = 10;

struct ConstantOutput {
  std::string name;
  std::vector<std::int64_t> shape;
  std::vector<float> values;  ///< empty: zeros
  int type = kOnnxFloat;
};

struct ConstantNetwork {
  std::vector<ConstantOutput> outputs;
  std::vector<std::int64_t> input{1, 3, 48, 64};  ///< -1: open
  int input_type = kOnnxFloat;
  std::vector<std::string> further_inputs{};
  std::vector<std::pair<std::string, std::string>> metadata{};
};

/// A value_info of any type, with open sizes.
inline Message typed_value_info(const std::string& name, const std::vector<std::int64_t>& shape, int type) {
  Message dims;
  for (const auto n : shape)
    dims.message(1, n < 0 ? Message().bytes(2, "any") : Message().number(1, static_cast<std::uint64_t>(n)));
  const Message tensor_type = Message().number(1, static_cast<std::uint64_t>(type)).message(2, dims);
  return Message().bytes(1, name).message(2, Message().message(1, tensor_type));
}

/// output = cast(mean(image) * 0 + constant)
inline void write_onnx(const std::filesystem::path& path, const ConstantNetwork& network) {
  const auto node = [](const char* op, const std::vector<std::string>& in, const std::string& out) {
    Message m;
    for (const auto& name : in) m.bytes(1, name);
    return m.bytes(2, out).bytes(4, op);
  };
  const auto cast = [&](const std::string& in, const std::string& out, int type) {
    const Message to = Message().bytes(1, "to").number(3, static_cast<std::uint64_t>(type)).number(20, 2);
    return node("Cast", {in}, out).message(5, to);
  };
  Message graph;
  graph.message(1, cast("image", "float_image", kOnnxFloat));
  const Message flat = Message().bytes(1, "keepdims").number(3, 0).number(20, 2);
  graph.message(1, node("ReduceMean", {"float_image"}, "mean").message(5, flat));
  graph.message(1, node("Mul", {"mean", "zero"}, "nothing"));
  graph.message(5, tensor("zero", {}, {0.0F}));
  graph.message(11, typed_value_info("image", network.input, network.input_type));
  for (const auto& name : network.further_inputs)
    graph.message(11, typed_value_info(name, {1, 2}, kOnnxFloat));
  for (const ConstantOutput& o : network.outputs) {
    std::size_t count = 1;
    for (const auto n : o.shape) count *= static_cast<std::size_t>(n);
    std::vector<float> values = o.values;
    values.resize(count);
    graph.message(5, tensor(o.name + "_values", o.shape, values));
    graph.message(1, node("Add", {"nothing", o.name + "_values"}, o.name + "_float"));
    graph.message(1, cast(o.name + "_float", o.name, o.type));
    graph.message(12, typed_value_info(o.name, o.shape, o.type));
  }
  graph.bytes(2, "constant");
  Message model;
  model.number(1, 7).message(7, graph).message(8, Message().bytes(1, "").number(2, 12));
  for (const auto& [key, value] : network.metadata)
    model.message(14, Message().bytes(1, key).bytes(2, value));
  std::ofstream(path, std::ios::binary) << model.text();
}

/// Values of channels x height x width: `inside` in the middle quarter, `outside` around it; of one channel.
inline std::vector<float> middle(std::int64_t height, std::int64_t width, float inside, float outside) {
  std::vector<float> values;
  for (std::int64_t v = 0; v < height; ++v) {
    for (std::int64_t u = 0; u < width; ++u) {
      const bool in = 4 * v >= height && 4 * v < 3 * height && 4 * u >= width && 4 * u < 3 * width;
      values.push_back(in ? inside : outside);
    }
  }
  return values;
}

}  // namespace dynslam::test
