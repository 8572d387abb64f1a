// SPDX-License-Identifier: BSD-3-Clause
#include "nets/late_masks.hpp"

#include <utility>

#include "dynslam/runtime/stopwatch.hpp"
#include "io/argument_check.hpp"
#include "threads/thread_priority.hpp"

namespace dynslam::runtime {
namespace {

/// Frames that are kept for carrying while the network is at work; of more every other one will do.
constexpr std::size_t kSteps = 8;

/// The network alone, of each frame that it gets; carrying is done here.
FrameSegmenterOptions network_alone(FrameSegmenterOptions options) {
  options.every = 1;
  options.keep = false;
  return options;
}

MaskKeeperOptions in_seconds(MaskKeeperOptions options, double longest_age) {
  options.max_seconds = longest_age;  // frames come at no fixed rate here
  return options;
}

}  // namespace

LateMasks::LateMasks(const FrameSegmenterOptions& options, double longest_age)
    : options_(options),
      longest_age_(longest_age),
      network_(network_alone(options)),
      keeper_(in_seconds(options.keeper, longest_age)) {
  check_argument(options.every >= 0, "LateMasks: `every` must be 0 or more");
  check_argument(options.keep, "a live schedule carries masks: `keep` must be true");
  thread_ = std::jthread([this](const std::stop_token& stop) { work(stop); });
}

LateMasks::Carried LateMasks::next(const RgbdFrame& frame) {
  Carried out;
  Stopwatch watch;
  {
    const std::lock_guard lock(mutex_);
    if (failure_) std::rethrow_exception(failure_);
    if (found_) {
      keeper_ = std::move(found_->keeper);
      seen_t_ = found_->t;
      seen_labels_ = std::move(found_->labels);
      out.network_ms = found_->network_ms;
      found_.reset();
      ++seen_;
    }
  }
  offer(frame);
  Masks carried = keeper_.update(std::nullopt, frame.gray, frame.depth, frame.t);
  if (seen_t_ && frame.t - *seen_t_ <= longest_age_) {
    out.masks = std::move(carried);
    out.masks->earlier = seen_labels_;
    out.age = frame.t - *seen_t_;
  }
  out.keeper_ms = watch.lap_ms();
  return out;
}

void LateMasks::offer(const RgbdFrame& frame) {
  const bool wanted = options_.every == 0 || frames_++ % static_cast<std::size_t>(options_.every) == 0;
  const std::lock_guard lock(mutex_);
  if (!busy_ && wanted) {
    job_ = frame;
    before_job_ = keeper_;
    busy_ = true;
    since_.clear();
    changed_.notify_all();
  } else if (busy_) {
    since_.push_back({frame.gray, frame.depth, frame.t});
    if (since_.size() <= kSteps) return;
    for (std::size_t i = 0; i + 1 < since_.size(); ++i) since_.erase(since_.begin() + static_cast<long>(i));
  }
}

void LateMasks::work(const std::stop_token& stop) {
  step_back(StepBack::far);
  try {
    while (true) {
      RgbdFrame frame;
      Found found;
      {
        std::unique_lock lock(mutex_);
        if (!changed_.wait(lock, stop, [this] { return job_.has_value(); })) return;
        frame = std::move(*job_);
        job_.reset();
        found.keeper = std::move(before_job_);
      }
      found.t = frame.t;
      FrameMasks segmented = network_.segment(frame, 0);
      found.network_ms = segmented.network_ms;
      found.labels =
          labels_for_later(found.keeper.update(segmented.masks, frame.gray, frame.depth, frame.t), frame);
      catch_up(found);
    }
  } catch (...) {
    const std::lock_guard lock(mutex_);
    failure_ = std::current_exception();
    busy_ = false;
  }
}

void LateMasks::catch_up(Found& found) {
  while (true) {
    Image image;
    {
      const std::lock_guard lock(mutex_);
      // The next frame carries over the last step itself: who waited for the last would never be done where a
      // step takes as long as a frame.
      if (since_.size() <= 1) {
        since_.clear();
        found_ = std::move(found);
        busy_ = false;
        return;
      }
      image = std::move(since_.front());
      since_.pop_front();
    }
    (void)found.keeper.update(std::nullopt, image.gray, image.depth, image.t);
  }
}

bool LateMasks::busy() const {
  const std::lock_guard lock(mutex_);
  return busy_;
}

std::size_t LateMasks::seen() const {
  const std::lock_guard lock(mutex_);
  return seen_;
}

}  // namespace dynslam::runtime
