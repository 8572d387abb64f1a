// SPDX-License-Identifier: BSD-3-Clause
#include "slam/event_journal.hpp"

#include <string>
#include <utility>

#include "io/argument_check.hpp"

namespace dynslam::runtime {

void EventJournal::begin(const Tracker& tracker) {
  adjustments_ = tracker.adjustments();
  newest_ = tracker.map().newest();
}

void EventJournal::note(const Tracker& tracker, double t, const TrackResult* result) {
  if (tracker.adjustments() != adjustments_) add(events_.adjusted, AdjustedEvent{t, newest_});
  if (result == nullptr) return;
  note_state(*result, t);
  // Of a place that a keyframe shows already the map notes the pose alone, as one that is culled.
  for (int id = newest_ + 1; id <= tracker.map().newest(); ++id) {
    const Keyframe& keyframe = tracker.map().keyframe(id);
    if (!keyframe.culled())
      add(events_.keyframe, KeyframeEvent{id, keyframe.frame.t, tracker.map().pose(id).inverse()});
  }
  if (result->loop) add(events_.loop, LoopEvent{t, *result->loop});
}

void EventJournal::note_state(const TrackResult& result, double t) {
  if (result.state == TrackingState::lost) {
    if (frames_lost_ == 0) add(events_.lost, LostEvent{t});
    ++frames_lost_;
    lost_ = true;
  } else if (result.ok() && lost_) {
    add(events_.found, FoundEvent{t, frames_lost_, result.state == TrackingState::relocalised, result.T_w_c});
    frames_lost_ = 0;
    lost_ = false;
  }
}

void EventJournal::tell() {
  struct Telling {
    explicit Telling(bool& now) : now_(now) { now_ = true; }
    ~Telling() { now_ = false; }
    Telling(const Telling&) = delete;
    Telling& operator=(const Telling&) = delete;
    bool& now_;
  } const telling(telling_);
  while (!told_later_.empty()) {
    const std::function<void()> next = std::move(told_later_.front());
    told_later_.pop_front();
    next();
  }
}

void EventJournal::check_not_telling(const char* what) const {
  const std::string message = std::string(what) + " must not be called by a function of SlamOptions::events";
  check_argument(!telling_, message.c_str());
}

}  // namespace dynslam::runtime
