// SPDX-License-Identifier: BSD-3-Clause
#include "io/video_images.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/io/image_io.hpp"
#include "dynslam/runtime/io/read_file.hpp"
#ifdef DYNSLAM_HAVE_VIDEOIO
#include <opencv2/videoio.hpp>
#endif

namespace dynslam::runtime {

#ifdef DYNSLAM_HAVE_VIDEOIO

/// Frames in order: a frame behind the last is reached by decoding those between, an earlier one from the
/// start, since the positions that containers promise are a few frames off.
struct VideoImages::Video {
  explicit Video(std::filesystem::path path) : name(std::move(path)) { open(); }

  void open() {
    next = 0;
    try {
      capture.open(name.string());
      if (capture.isOpened()) {
        capture.set(cv::CAP_PROP_ORIENTATION_AUTO, 0);  // depth is not turned
        return;
      }
    } catch (const cv::Exception&) {  // said below
    }
    throw InputError(name.string(), 0, "cannot be opened as a video");
  }

  cv::Mat frame(std::size_t number) {
    if (number < next) open();
    cv::Mat image;
    bool found = true;
    for (; found && next < number; ++next) found = capture.grab();
    found = found && capture.read(image) && !image.empty();
    ++next;
    if (!found)
      throw InputError(name.string(), 0,
                       fmt::format("ends before frame {}, or cannot be decoded there", number));
    return image;
  }

  [[nodiscard]] cv::Size size() const {
    return {static_cast<int>(capture.get(cv::CAP_PROP_FRAME_WIDTH)),
            static_cast<int>(capture.get(cv::CAP_PROP_FRAME_HEIGHT))};
  }

  std::filesystem::path name;
  cv::VideoCapture capture;
  std::size_t next = 0;  // frame that the next read gives
};

#else

struct VideoImages::Video {
  explicit Video(const std::filesystem::path& path) {
    throw InputError(path.string(), 0, "is a video; this program was built without OpenCV's videoio");
  }
  cv::Mat frame(std::size_t) { return {}; }
  [[nodiscard]] cv::Size size() const { return {}; }
};

#endif

VideoImages::VideoImages(std::filesystem::path video, std::vector<VideoDepth> depth, cv::Size size)
    : depth_(std::move(depth)), size_(size), video_(std::make_unique<Video>(std::move(video))) {}

VideoImages::~VideoImages() = default;

cv::Size VideoImages::size(Kind, std::size_t) const {
  return size_;
}

cv::Mat VideoImages::read(Kind kind, std::size_t number) const {
  return kind == Kind::colour ? colour(number) : depth(number);
}

std::vector<std::uint8_t> VideoImages::content(Kind kind, std::size_t number) const {
  if (kind == Kind::depth) {
    const std::string bytes = read_file(depth_.at(number).depth);
    return {bytes.begin(), bytes.end()};
  }
  const cv::Mat image = colour(number);
  return {image.datastart, image.dataend};
}

cv::Mat VideoImages::colour(std::size_t number) const {
  const std::lock_guard lock(mutex_);
  const auto found =
      std::find_if(latest_.begin(), latest_.end(), [&](const auto& frame) { return frame.first == number; });
  if (found != latest_.end()) return found->second.clone();
  const cv::Mat image = video_->frame(number);
  if (image.type() != CV_8UC3)
    throw InputError(depth_.at(number).depth.string(), 0, "the video's frame is not of three colours");
  cv::Mat scaled;
  cv::resize(image, scaled, size_, 0, 0, cv::INTER_AREA);
  constexpr std::size_t kLatest = 8;
  if (latest_.size() == kLatest) latest_.pop_front();
  latest_.emplace_back(number, scaled);
  return scaled.clone();
}

cv::Mat VideoImages::depth(std::size_t number) const {
  const VideoDepth& files = depth_.at(number);
  cv::Mat values = read_image(files.depth, cv::IMREAD_UNCHANGED);
  if (!files.confidence.empty()) {
    const cv::Mat confidence = read_image(files.confidence, cv::IMREAD_UNCHANGED);
    if (confidence.size() != values.size() || confidence.type() != CV_8UC1)
      throw InputError(files.confidence.string(), 0, "is no 8-bit image of the depth image's size");
    values.setTo(0, confidence == 0);
  }
  cv::Mat scaled;
  cv::resize(values, scaled, size_, 0, 0, cv::INTER_NEAREST_EXACT);
  return scaled;
}

cv::Size VideoImages::stored_size(const std::filesystem::path& video) {
  return Video(video).size();
}

}  // namespace dynslam::runtime
