// SPDX-License-Identifier: BSD-3-Clause
#include "nets/onnx_header.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <set>
#include <string_view>
#include <utility>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/read_file.hpp"

namespace dynslam::runtime {
namespace {

constexpr std::uint64_t kLongest = std::uint64_t(1) << 31;  // a protocol-buffer message is no longer

// Field numbers of onnx.proto.
constexpr std::uint64_t kModelGraph = 7, kModelMetadata = 14;
constexpr std::uint64_t kGraphInitializer = 5, kGraphInput = 11, kGraphOutput = 12, kTensorName = 8;
constexpr std::uint64_t kModelFunctions = 25, kModelTraining = 20, kTensorExternal = 13;
constexpr std::uint64_t kKey = 1, kValue = 2;  // StringStringEntryProto
constexpr std::uint64_t kName = 1, kType = 2;  // ValueInfoProto
constexpr std::uint64_t kTensorType = 1, kElementType = 1, kShape = 2, kDim = 1, kDimValue = 1;
constexpr std::uint64_t kGraphNode = 1, kNodeOutput = 2, kNodeName = 3;

/// Fields of one protocol-buffer message, in order (https://protobuf.dev/programming-guides/encoding/).
class Fields {
 public:
  explicit Fields(std::string_view message) : rest_(message) {}

  struct Field {
    std::uint64_t number;
    std::uint64_t value;     // of a number
    std::string_view bytes;  // of a string or message
  };

  /// nullopt at the end and where the message is damaged.
  std::optional<Field> next() {
    const auto key = varint();
    if (!key) return std::nullopt;
    Field field{*key >> 3, 0, {}};
    switch (*key & 7) {
      case 0: {
        const auto value = varint();
        if (!value) return std::nullopt;
        field.value = *value;
        return field;
      }
      case 1:
        return skip(8) ? std::optional(field) : std::nullopt;
      case 5:
        return skip(4) ? std::optional(field) : std::nullopt;
      case 3:  // a group begins or ends; its fields are taken for the message's own, lest something hides
               // there
      case 4:
        return field;
      case 2: {
        const auto size = varint();
        if (!size || *size > rest_.size()) return std::nullopt;
        field.bytes = rest_.substr(0, static_cast<std::size_t>(*size));
        rest_.remove_prefix(static_cast<std::size_t>(*size));
        return field;
      }
      default:
        return std::nullopt;
    }
  }

 private:
  std::optional<std::uint64_t> varint() {
    std::uint64_t value = 0;
    for (int shift = 0; shift < 64 && !rest_.empty(); shift += 7) {
      const auto byte = static_cast<unsigned char>(rest_.front());
      rest_.remove_prefix(1);
      value |= static_cast<std::uint64_t>(byte & 127U) << shift;
      if ((byte & 128U) == 0) return value;
    }
    return std::nullopt;
  }
  bool skip(std::size_t n) {
    if (rest_.size() < n) return false;
    rest_.remove_prefix(n);
    return true;
  }
  std::string_view rest_;
};

/// Calls `visit` for each field of that number.
template <class Visit>
void for_each(std::string_view message, std::uint64_t number, Visit&& visit) {
  Fields fields(message);
  while (const auto field = fields.next()) {
    if (field->number == number) visit(*field);
  }
}

std::string text_of(std::string_view message, std::uint64_t number) {
  std::string text;
  for_each(message, number, [&](const Fields::Field& f) { text = std::string(f.bytes); });
  return text;
}

TensorInfo value_info(std::string_view message) {
  TensorInfo info{text_of(message, kName), {}, 0};
  for_each(message, kType, [&](const Fields::Field& type) {
    for_each(type.bytes, kTensorType, [&](const Fields::Field& tensor) {
      for_each(tensor.bytes, kElementType, [&](const Fields::Field& f) {
        info.type = static_cast<int>(std::min<std::uint64_t>(f.value, 1000));
      });
      for_each(tensor.bytes, kShape, [&](const Fields::Field& shape) {
        for_each(shape.bytes, kDim, [&](const Fields::Field& dim) {
          std::int64_t size = -1;  // a name instead of a number: any
          for_each(dim.bytes, kDimValue,
                   [&](const Fields::Field& f) { size = static_cast<std::int64_t>(f.value); });
          info.shape.push_back(size);
        });
      });
    });
  });
  return info;
}

/// A kind of message, and where others are in it that may name files.
enum class Kind { model, graph, training, function, node, attribute, sparse, tensor };
struct Inner {
  Kind outer;
  std::uint64_t number;
  Kind inner;
};
constexpr std::array<Inner, 16> kInner{{{Kind::model, kModelGraph, Kind::graph},
                                        {Kind::model, kModelTraining, Kind::training},
                                        {Kind::model, kModelFunctions, Kind::function},
                                        {Kind::training, 1, Kind::graph},
                                        {Kind::training, 2, Kind::graph},
                                        {Kind::function, 7, Kind::node},
                                        {Kind::graph, 1, Kind::node},
                                        {Kind::graph, kGraphInitializer, Kind::tensor},
                                        {Kind::graph, 15, Kind::sparse},
                                        {Kind::sparse, 1, Kind::tensor},
                                        {Kind::sparse, 2, Kind::tensor},
                                        {Kind::node, 5, Kind::attribute},
                                        {Kind::attribute, 5, Kind::tensor},
                                        {Kind::attribute, 10, Kind::tensor},
                                        {Kind::attribute, 6, Kind::graph},
                                        {Kind::attribute, 11, Kind::graph}}};

void collect_external(std::string_view message, Kind kind, int depth, std::vector<std::string>& out) {
  constexpr int kDeepest = 200;  // protocol buffers' own limit is 100 messages
  if (depth > kDeepest) return;
  Fields fields(message);
  while (const auto field = fields.next()) {
    if (kind == Kind::tensor && field->number == kTensorExternal && text_of(field->bytes, kKey) == "location")
      out.push_back(text_of(field->bytes, kValue));
    if (kind == Kind::attribute && (field->number == 22 || field->number == 23))
      collect_external(field->bytes, Kind::sparse, depth + 1, out);
    for (const Inner& inner : kInner) {
      if (inner.outer == kind && inner.number == field->number)
        collect_external(field->bytes, inner.inner, depth + 1, out);
    }
  }
}

}  // namespace

std::vector<std::string> external_files(const std::filesystem::path& file) {
  const std::string content = read_file(file, kLongest);
  std::vector<std::string> files;
  collect_external(content, Kind::model, 0, files);
  return files;
}

void check_external_files(const std::filesystem::path& file) {
  namespace fs = std::filesystem;
  const fs::path folder = fs::canonical(fs::absolute(file)).parent_path();
  for (const std::string& name : external_files(file)) {
    const fs::path path(name), real = fs::weakly_canonical(folder / path);
    const bool inside =
        std::mismatch(folder.begin(), folder.end(), real.begin(), real.end()).first == folder.end();
    if (path.is_absolute() || !inside)
      throw InputError(file.string(), 0, "takes weights from outside its folder: " + name);
    check_regular_file(real);
  }
}

OnnxHeader read_onnx_header(const std::filesystem::path& file) {
  const std::string content = read_file(file, kLongest);
  OnnxHeader header;
  for_each(content, kModelMetadata, [&](const Fields::Field& f) {
    header.metadata[text_of(f.bytes, kKey)] = text_of(f.bytes, kValue);
  });
  for_each(content, kModelGraph, [&](const Fields::Field& graph) {
    std::set<std::string> weights;  // old files list them among the inputs
    for_each(graph.bytes, kGraphInitializer,
             [&](const Fields::Field& f) { weights.insert(text_of(f.bytes, kTensorName)); });
    for_each(graph.bytes, kGraphInput, [&](const Fields::Field& f) {
      TensorInfo info = value_info(f.bytes);
      if (weights.count(info.name) == 0) header.inputs.push_back(std::move(info));
    });
    for_each(graph.bytes, kGraphOutput,
             [&](const Fields::Field& f) { header.outputs.push_back(value_info(f.bytes)); });
    for_each(graph.bytes, kGraphNode, [&](const Fields::Field& node) {
      for_each(node.bytes, kNodeOutput, [&](const Fields::Field& f) {
        header.makers[std::string(f.bytes)] = text_of(node.bytes, kNodeName);
      });
    });
  });
  return header;
}

}  // namespace dynslam::runtime
