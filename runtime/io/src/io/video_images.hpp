// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <deque>
#include <filesystem>
#include <memory>
#include <mutex>
#include <opencv2/core.hpp>
#include <utility>
#include <vector>

#include "dynslam/runtime/io/image_source.hpp"

namespace dynslam::runtime {

/// A depth image of a video's frame.
struct VideoDepth {
  std::filesystem::path depth, confidence;  ///< confidence: empty where there is none
};

/// Colour from a video file, depth from files of its own and of any size: both are scaled to one size.
/// Colours by area; depth takes the nearest value, since a mean of two surfaces is none; what the sensor is
/// not sure of (confidence 0) is none.
class VideoImages : public ImageSource {
 public:
  /// @param depth  of the video's frames 0, 1, ...; a frame without depth has an empty name
  /// @param size   of the images returned [px]
  VideoImages(std::filesystem::path video, std::vector<VideoDepth> depth, cv::Size size);
  ~VideoImages() override;
  /// Of a video's frames as they are stored [px]. @throws InputError where it cannot be opened, or this
  /// program was built without OpenCV's videoio
  [[nodiscard]] static cv::Size stored_size(const std::filesystem::path& video);

  [[nodiscard]] cv::Mat read(Kind kind, std::size_t number) const override;
  [[nodiscard]] cv::Size size(Kind kind, std::size_t number) const override;
  [[nodiscard]] std::vector<std::uint8_t> content(Kind kind, std::size_t number) const override;

 private:
  struct Video;
  [[nodiscard]] cv::Mat colour(std::size_t number) const;
  [[nodiscard]] cv::Mat depth(std::size_t number) const;

  std::vector<VideoDepth> depth_;
  cv::Size size_;
  mutable std::mutex mutex_;  // of what follows: a video is read in order
  std::unique_ptr<Video> video_;
  mutable std::deque<std::pair<std::size_t, cv::Mat>>
      latest_;  // frames returned, for those who compare neighbours
};

}  // namespace dynslam::runtime
