// SPDX-License-Identifier: BSD-3-Clause
// Writes ONNX files small enough to know what they must answer.
#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

namespace dynslam::test {

/// A protocol-buffer message under construction (https://protobuf.dev/programming-guides/encoding/).
class Message {
 public:
  Message& number(int field, std::uint64_t value) {
    key(field, 0);
    varint(value);
    return *this;
  }
  Message& bytes(int field, const std::string& value) {
    key(field, 2);
    varint(value.size());
    text_ += value;
    return *this;
  }
  Message& message(int field, const Message& value) { return bytes(field, value.text_); }
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  void key(int field, int type) {
    varint((static_cast<std::uint64_t>(field) << 3) | static_cast<std::uint64_t>(type));
  }
  void varint(std::uint64_t value) {
    for (; value >= 128; value >>= 7) text_ += static_cast<char>(static_cast<unsigned char>(value | 128));
    text_ += static_cast<char>(static_cast<unsigned char>(value));
  }
  std::string text_;
};

inline Message tensor(const std::string& name, const std::vector<std::int64_t>& shape,
                      const std::vector<float>& values) {
  Message m;
  for (const auto n : shape) m.number(1, static_cast<std::uint64_t>(n));
  std::string raw(values.size() * sizeof(float), '\0');
  std::memcpy(raw.data(), values.data(), raw.size());
  return m.number(2, 1).bytes(8, name).bytes(9, raw);
}

inline Message value_info(const std::string& name, const std::vector<std::int64_t>& shape) {
  Message dims;
  for (const auto n : shape) dims.message(1, Message().number(1, static_cast<std::uint64_t>(n)));
  return Message().bytes(1, name).message(2, Message().message(1, Message().number(1, 1).message(2, dims)));
}

/// What a colour-picking network looks like: one 1 x 1 convolution from 3 channels to `weights.size()`
/// classes, each {weight of red, green, blue, bias}.
struct TinyNetwork {
  std::vector<std::array<float, 4>> weights;
  int width = 64, height = 48, channels = 3;
  std::string output = "out";
  std::string before{};  ///< a further output before it, of the opposite sign; empty: none
  std::vector<std::pair<std::string, std::string>> metadata;
};

inline void write_onnx(const std::filesystem::path& path, const TinyNetwork& network) {
  const auto classes = static_cast<std::int64_t>(network.weights.size());
  std::vector<float> w, b;
  for (const auto& row : network.weights) {
    for (int c = 0; c < network.channels; ++c) w.push_back(row[static_cast<std::size_t>(c % 3)]);
    b.push_back(row[3]);
  }
  Message graph;
  const auto add_output = [&](const std::string& name, const std::string& layer) {
    const Message node =
        Message()
            .bytes(1, "image")
            .bytes(1, layer + "w")
            .bytes(1, layer + "b")
            .bytes(2, name)
            .bytes(3, layer + "conv")
            .bytes(4, "Conv")
            .message(5, Message().bytes(1, "kernel_shape").number(8, 1).number(8, 1).number(20, 7));
    graph.message(1, node);
    graph.message(5, tensor(layer + "w", {classes, network.channels, 1, 1}, w));
    graph.message(5, tensor(layer + "b", {classes}, b));
    graph.message(12, value_info(name, {1, classes, network.height, network.width}));
  };
  graph.bytes(2, "tiny");
  graph.message(11, value_info("image", {1, network.channels, network.height, network.width}));
  if (!network.before.empty()) {
    for (std::vector<float>* values : {&w, &b})
      for (float& x : *values) x = -x;
    add_output(network.before, "before_");
    for (std::vector<float>* values : {&w, &b})
      for (float& x : *values) x = -x;
  }
  add_output(network.output, "");
  Message model;
  model.number(1, 7).message(7, graph).message(8, Message().bytes(1, "").number(2, 12));
  for (const auto& [key, value] : network.metadata)
    model.message(14, Message().bytes(1, key).bytes(2, value));
  std::ofstream(path, std::ios::binary) << model.text();
}

/// Background, person where it is red, chair where it is green, display where it is blue.
inline TinyNetwork colour_network() {
  TinyNetwork network;
  network.weights = {{0, 0, 0, 0}, {1, -1, -1, -1}, {-1, 1, -1, -1}, {-1, -1, 1, -1}};
  return network;
}

}  // namespace dynslam::test
