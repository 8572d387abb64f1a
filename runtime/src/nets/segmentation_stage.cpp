// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/nets/segmentation_stage.hpp"

#include <exception>
#include <utility>

#include "threads/thread_priority.hpp"

namespace dynslam::runtime {

SegmentationStage::SegmentationStage(FrameStream& frames, const SegmentationStageOptions& options)
    : frames_(frames), async_(options.async), segmenter_(options), queue_(options.queue) {
  if (async_) thread_ = std::jthread([this](const std::stop_token& stop) { work(stop); });
}

std::optional<SegmentedFrame> SegmentationStage::process() {
  auto next = frames_.next();
  if (!next) return std::nullopt;
  SegmentedFrame out;
  out.frame = std::move(*next);
  if (out.frame.frame) out.segmented = segmenter_.segment(*out.frame.frame, out.frame.index);
  return out;
}

std::optional<SegmentedFrame> SegmentationStage::next() {
  return async_ ? queue_.pop() : process();
}

std::string SegmentationStage::describe() {
  if (thread_.joinable()) {
    thread_.request_stop();
    queue_.close();
    thread_.join();
  }
  return segmenter().describe();
}

void SegmentationStage::work(const std::stop_token& stop) {
  step_back(StepBack::far);
  try {
    while (auto frame = process()) {
      if (!queue_.push(std::move(*frame), stop)) return;
    }
    queue_.close();
  } catch (...) {
    queue_.close(std::current_exception());
  }
}

}  // namespace dynslam::runtime
