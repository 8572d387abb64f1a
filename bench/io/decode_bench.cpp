// SPDX-License-Identifier: BSD-3-Clause
// Decoding 640 x 480 PNGs, 8 bit colour and 16 bit depth: what the runtime does with the bytes of a file
// (checks of the file included) beside OpenCV's imdecode and libspng, which checks as much. The images are
// recorded ones where DYNSLAM_DATA names the data, made-up ones otherwise; each is decoded to the same
// pixels.
#include <benchmark/benchmark.h>

#ifdef DYNSLAM_BENCH_OPENCV
#include <cmath>
#include <cstdint>
#include <memory>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#ifdef DYNSLAM_BENCH_SPNG
#include <spng.h>
#endif
#include "dynslam/runtime/io/image_io.hpp"
#include "dynslam/runtime/io/read_file.hpp"
#include "support/named.hpp"
#include "support/recorded_files.hpp"
#include "support/rng.hpp"

namespace {

using namespace dynslam;

/// A wave with noise, as a camera of the kind would see it.
cv::Mat made_up(bool colour) {
  bench::Random random(41);
  cv::Mat image(480, 640, colour ? CV_8UC3 : CV_16UC1);
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) {
      const double wave = std::sin(0.02 * u) * std::cos(0.03 * v);
      if (colour) {
        const auto grey = [&] { return static_cast<std::uint8_t>(128 + 80 * wave + random.uniform(-5, 5)); };
        image.at<cv::Vec3b>(v, u) = {grey(), grey(), grey()};
      } else {
        image.at<std::uint16_t>(v, u) =
            static_cast<std::uint16_t>(10000 + 2000 * wave + random.uniform(-20, 20));
      }
    }
  }
  return image;
}

/// Bytes of a PNG.
std::string encoded(bool colour) {
  const auto files = bench::recorded_files(colour ? "rgb" : "depth");
  if (!files.empty()) return runtime::read_file(files.front());
  std::vector<std::uint8_t> bytes;
  cv::imencode(".png", made_up(colour), bytes);
  return {bytes.begin(), bytes.end()};
}

int flags_of(bool colour) {
  return colour ? cv::IMREAD_COLOR : cv::IMREAD_UNCHANGED;
}
cv::Mat by_opencv(const std::string& bytes, bool colour) {
  const cv::Mat data(1, static_cast<int>(bytes.size()), CV_8UC1, const_cast<char*>(bytes.data()));
  return cv::imdecode(data, flags_of(colour));
}

#ifdef DYNSLAM_BENCH_SPNG
cv::Mat by_spng(const std::string& bytes, bool colour) {
  const std::unique_ptr<spng_ctx, decltype(&spng_ctx_free)> context(spng_ctx_new(0), spng_ctx_free);
  spng_ihdr header;
  if (spng_set_png_buffer(context.get(), bytes.data(), bytes.size()) != 0 ||
      spng_get_ihdr(context.get(), &header) != 0)
    return {};
  cv::Mat image(static_cast<int>(header.height), static_cast<int>(header.width), colour ? CV_8UC3 : CV_16UC1);
  // As the file has its samples, in the machine's byte order.
  if (spng_decode_image(context.get(), image.data, image.total() * image.elemSize(), SPNG_FMT_PNG, 0) != 0)
    return {};
  if (colour) cv::cvtColor(image, image, cv::COLOR_RGB2BGR);
  return image;
}
#endif

template <class Decode>
void time_decoder(benchmark::State& state, bool colour, const Decode& decode) {
  cv::setNumThreads(1);
  const std::string bytes = encoded(colour);
  const cv::Mat expected = by_opencv(bytes, colour), found = decode(bytes);
  if (expected.empty() || found.size() != expected.size() || found.type() != expected.type() ||
      cv::norm(found, expected, cv::NORM_INF) != 0) {
    state.SkipWithError("other pixels");
    return;
  }
  for (auto _ : state) {
    const cv::Mat image = decode(bytes);
    benchmark::DoNotOptimize(image.data);
  }
  state.SetBytesProcessed(state.iterations() *
                          static_cast<std::int64_t>(expected.total() * expected.elemSize()));
  state.counters["file_bytes"] = static_cast<double>(bytes.size());
}

const bool registered = [] {
  for (const bool colour : {true, false}) {
    const std::string what = colour ? "decode/png_colour_640x480" : "decode/png_depth_640x480";
    const char* type = colour ? "uint8" : "uint16";
    bench::add(what, type, "dynslam", [=](benchmark::State& s) {
      time_decoder(s, colour, [=](const std::string& bytes) {
        return runtime::EncodedImage("image.png", bytes).decode(flags_of(colour));
      });
    });
    bench::add(what, type, "opencv", [=](benchmark::State& s) {
      time_decoder(s, colour, [=](const std::string& bytes) { return by_opencv(bytes, colour); });
    });
#ifdef DYNSLAM_BENCH_SPNG
    bench::add(what, type, "libspng", [=](benchmark::State& s) {
      time_decoder(s, colour, [=](const std::string& bytes) { return by_spng(bytes, colour); });
    });
#endif
  }
  return true;
}();

}  // namespace
#endif

BENCHMARK_MAIN();
