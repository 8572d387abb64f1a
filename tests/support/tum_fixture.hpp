// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <opencv2/core.hpp>
#include <string>

#include "dynslam/runtime/io/image_io.hpp"

namespace dynslam::test {

/// A folder that exists as long as the object.
struct TemporaryFolder {
  std::filesystem::path path;
  TemporaryFolder() {
    static std::atomic<int> count{0};
    path = std::filesystem::temp_directory_path() /
           ("dynslam_test_" + std::to_string(getpid()) + "_" + std::to_string(count++));
    std::filesystem::create_directories(path);
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
};

inline void write_file(const std::filesystem::path& path, const std::string& content) {
  std::ofstream(path, std::ios::binary) << content;
}

/// A tiny, valid TUM sequence: 64x64 images, depth 1.5 m with one missing pixel.
struct TumFixture : TemporaryFolder {
  explicit TumFixture(int frames) {
    for (const char* folder : {"rgb", "depth"}) std::filesystem::create_directories(path / folder);
    std::ofstream rgb(path / "rgb.txt"), depth(path / "depth.txt"), truth(path / "groundtruth.txt");
    std::ofstream(path / "camera.txt") << "width = 64\nheight = 64\nfx = 60\nfy = 60\ncx = 32\ncy = 32\n";
    cv::Mat colour(64, 64, CV_8UC3), raw(64, 64, CV_16UC1, cv::Scalar(7500));
    cv::RNG random(1);
    random.fill(colour, cv::RNG::UNIFORM, 0, 255);
    raw.at<std::uint16_t>(0, 0) = 0;
    for (int i = 0; i < frames; ++i) {
      char stamp[32];
      std::snprintf(stamp, sizeof stamp, "%d.%06d", 1 + i / 30, (i % 30) * 1000000 / 30);
      rgb << stamp << " rgb/" << stamp << ".png\n";
      depth << stamp << " depth/" << stamp << ".png\n";
      truth << stamp << ' ' << 0.01 * i << " 0 0 0 0 0 1\n";
      runtime::write_image(path / "rgb" / (std::string(stamp) + ".png"), colour);
      runtime::write_image(path / "depth" / (std::string(stamp) + ".png"), raw);
    }
  }
};

}  // namespace dynslam::test
