// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <deque>
#include <functional>
#include <utility>

#include "dynslam/runtime/slam/slam_events.hpp"
#include "dynslam/runtime/slam/tracker.hpp"

namespace dynslam::runtime {

/// Finds out what happened at a frame, and tells it afterwards.
class EventJournal {
 public:
  explicit EventJournal(SlamEvents events) : events_(std::move(events)) {}
  EventJournal(const EventJournal&) = delete;
  EventJournal& operator=(const EventJournal&) = delete;

  /// Before a step of the tracker.
  void begin(const Tracker& tracker);
  /// After it. @param result  of the frame; null where there was none
  void note(const Tracker& tracker, double t, const TrackResult* result);
  void begun(const MapBegunEvent& event) { add(events_.map_begun, event); }
  void joined(const MapJoinedEvent& event) { add(events_.map_joined, event); }
  /// The camera is lost in a map that was loaded, and nobody was told.
  void loaded() { lost_ = true; }
  /// Calls the user's functions. @throws what they throw
  void tell();
  /// @throws UsageError in a call of one of them, naming `what`
  void check_not_telling(const char* what) const;

 private:
  void note_state(const TrackResult& result, double t);
  template <class Event>
  void add(const std::function<void(const Event&)>& function, const Event& event) {
    if (function) told_later_.emplace_back([&function, event] { function(event); });
  }

  SlamEvents events_;
  std::deque<std::function<void()>> told_later_;
  bool telling_ = false;
  std::size_t adjustments_ = 0;  // before the step
  int newest_ = -1;
  bool lost_ = false;
  std::size_t frames_lost_ = 0;
};

}  // namespace dynslam::runtime
