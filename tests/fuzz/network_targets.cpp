// SPDX-License-Identifier: BSD-3-Clause
#include <array>
#include <cstring>
#include <fstream>
#include <numeric>
#include <utility>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/nets/model_output.hpp"
#include "dynslam/runtime/nets/segmentation_decoders.hpp"
#include "io/mask_image.hpp"
#include "mask_files.hpp"
#include "nets/model_recognition.hpp"
#include "nets/onnx_header.hpp"
#include "run_fixture.hpp"
#include "targets.hpp"

namespace dynslam::fuzz {
namespace {

using namespace runtime;

void onnx_header(Bytes bytes) {
  static const test::TemporaryFolder folder;
  const auto file = folder.path / "m.onnx";
  std::ofstream(file, std::ios::binary) << text_of(bytes);
  try {
    (void)read_onnx_header(file);
  } catch (const InputError&) {
  }
}

/// Takes numbers from the input, zeros when it is used up.
class Source {
 public:
  explicit Source(Bytes bytes) : left_(bytes) {}
  [[nodiscard]] int below(int n) { return byte() % n; }
  [[nodiscard]] float number() {
    std::uint8_t raw[4] = {byte(), byte(), byte(), byte()};
    float value;
    std::memcpy(&value, raw, sizeof value);
    return value;
  }
  /// Of the given shape, or of one dimension more, less or other.
  [[nodiscard]] Tensor tensor(std::vector<std::int64_t> shape) {
    const int odd = below(8);
    if (odd == 1) shape.push_back(1 + below(3));
    if (odd == 2 && !shape.empty()) shape.pop_back();
    if (odd == 3 && !shape.empty())
      shape[static_cast<std::size_t>(below(static_cast<int>(shape.size())))] = below(4);
    Tensor tensor{"t", shape, {}};
    const auto n = std::accumulate(shape.begin(), shape.end(), std::int64_t{1}, std::multiplies<>());
    for (std::int64_t i = 0; i < n; ++i) tensor.data.push_back(number());
    return tensor;
  }

 private:
  [[nodiscard]] std::uint8_t byte() {
    if (left_.empty()) return 0;
    const std::uint8_t b = left_.front();
    left_ = left_.subspan(1);
    return b;
  }
  Bytes left_;
};

const cv::Size kImage(64, 48);

/// Outputs of any shapes: a segmenter or a line that says what it is.
void model_outputs(Bytes bytes) {
  Source in(bytes);
  const std::array<const char*, 6> names{"output0", "output1", "boxes", "masks", "out", "depth"};
  std::vector<Tensor> outputs;
  for (int count = in.below(5); count > 0; --count) {
    Tensor t{names[static_cast<std::size_t>(in.below(6))], {}, {}, in.below(2) == 1};
    for (int rank = in.below(6); rank > 0; --rank)
      t.shape.push_back(in.below(2) == 0 ? in.below(40) : 4 * in.below(40));
    outputs.push_back(std::move(t));
  }
  try {
    (void)recognise_outputs(outputs, {"m.onnx", ModelKind::automatic, "", {64, 48}, {}});
  } catch (const InputError&) {
  }
}

/// Values of one channel over two frames.
void channel(Bytes bytes) {
  Source in(bytes);
  const int classes = in.below(4);
  ChannelReader reader(ModelOutput::automatic, static_cast<std::size_t>(classes), "m.onnx");
  try {
    for (int frame = 0; frame < 2; ++frame) reader.look(in.tensor({1, 1, 3, 4}));
  } catch (const InputError&) {
  }
  (void)reader.describe();
}

void mask_file(Bytes bytes) {
  for (const bool by_index : {false, true}) {
    try {
      (void)read_mask_image(EncodedImage("m.png", text_of(bytes)), by_index);
    } catch (const InputError&) {
    }
  }
}

/// A mask of every kind.
std::vector<std::string> mask_files() {
  const test::TemporaryFolder folder;
  std::vector<std::string> files;
  for (const test::MaskFiles& kind : test::every_kind_of_mask()) {
    kind.write(folder.path / "m.png", {32, 24});
    files.push_back(test::bytes(folder.path / "m.png"));
  }
  return files;
}

void yolo(Bytes bytes) {
  Source in(bytes);
  const int classes = 1 + in.below(3), prototypes = 1 + in.below(3), boxes = in.below(5);
  const Tensor predictions = in.tensor({1, 4 + classes + prototypes, boxes});
  const Tensor masks = in.tensor({1, prototypes, 6, 8});
  try {
    (void)decode_yolo(predictions, masks, fit_letterbox(64, 48, 32, 24), kImage, {}, "m.onnx");
  } catch (const InputError&) {
  }
}

void mask_rcnn(Bytes bytes) {
  Source in(bytes);
  const int n = in.below(5);
  const Tensor boxes = in.tensor({n, 4}), labels = in.tensor({n}), scores = in.tensor({n});
  const Tensor masks = in.tensor({n, 1, 28, 28});
  try {
    (void)decode_mask_rcnn(boxes, labels, scores, masks, fit_stretched(64, 48, 32, 24), kImage, {}, "m.onnx");
  } catch (const InputError&) {
  }
}

void semantic(Bytes bytes) {
  Source in(bytes);
  const bool align = in.below(2) == 1;
  const Tensor output = in.tensor({1, 1 + in.below(4), 6, 8});
  try {
    (void)decode_semantic(output, fit_stretched(64, 48, 32, 24), kImage, align, "m.onnx");
  } catch (const InputError&) {
  }
}

/// Bytes whose numbers are of an image's order of magnitude.
std::vector<std::string> plausible(std::size_t numbers) {
  std::string bytes(4, '\2');
  for (std::size_t i = 0; i < numbers; ++i) {
    const float value = static_cast<float>(i % 23) * (i % 5 == 0 ? -1.0F : 0.5F);
    bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  return {bytes};
}

}  // namespace

void add_network_targets(std::vector<Target>& targets) {
  targets.push_back({"onnx_header", onnx_header, [] {
                       // An empty graph called "g", a name and a value of metadata.
                       return std::vector<std::string>{
                           std::string("\x08\x08\x3a\x03\x12\x01g\x72\x08\x0a\x01k\x12\x03val", 17)};
                     }});
  targets.push_back({"model_outputs", model_outputs, [] { return plausible(20); }});
  targets.push_back({"channel", channel, [] { return plausible(30); }});
  targets.push_back({"mask_file", mask_file, mask_files});
  targets.push_back({"yolo", yolo, [] { return plausible(200); }});
  targets.push_back({"mask_rcnn", mask_rcnn, [] { return plausible(1600); }});
  targets.push_back({"semantic", semantic, [] { return plausible(150); }});
}

}  // namespace dynslam::fuzz
