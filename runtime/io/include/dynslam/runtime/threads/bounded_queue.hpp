// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dynslam/push_macros.hpp"

#include <algorithm>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <exception>
#include <mutex>
#include <optional>
#include <stop_token>
#include <utility>

namespace dynslam::runtime {

/// Hands items from one thread to another in their order, at most `capacity` at a time; any number of threads
/// may push and pop.
///
/// The side that ends the work, for good or because it failed, calls close(). What is queued by then can
/// still be popped; after the last item pop() throws the failure that close() was given, or returns nothing.
/// A consumer that calls done() after each item lets others wait in join() until all of them are worked off.
template <class T>
class BoundedQueue {
 public:
  /// @param capacity  items waiting, at least 1 (0 is taken as 1)
  explicit BoundedQueue(std::size_t capacity) : capacity_(std::max<std::size_t>(1, capacity)) {}
  BoundedQueue(const BoundedQueue&) = delete;
  BoundedQueue& operator=(const BoundedQueue&) = delete;

  /// Appends an item; waits while the queue is full.
  /// @return false where the queue was closed or `stop` requested first: the item is dropped
  /// @throws what close() was given
  bool push(T item, const std::stop_token& stop = {}) {
    std::unique_lock lock(mutex_);
    const bool proceed = changed_.wait(lock, stop, [this] { return items_.size() < capacity_ || closed_; });
    if (failure_) std::rethrow_exception(failure_);
    if (!proceed || closed_ || stop.stop_requested()) return false;
    items_.push_back(std::move(item));
    ++unfinished_;
    changed_.notify_all();
    return true;
  }

  /// Appends an item without waiting: where the queue is full the first one makes room.
  /// @return the item that is dropped for it: the first one, or where the queue was closed, `item`
  /// @throws what close() was given
  std::optional<T> push_newest(T item) {
    const std::lock_guard lock(mutex_);
    if (failure_) std::rethrow_exception(failure_);
    std::optional<T> dropped;
    if (closed_) {
      dropped.emplace(std::move(item));
      return dropped;
    }
    if (items_.size() == capacity_) {
      dropped.emplace(std::move(items_.front()));
      items_.pop_front();
      --unfinished_;
    }
    items_.push_back(std::move(item));
    ++unfinished_;
    changed_.notify_all();
    return dropped;
  }

  /// Waits until there is room for an item, which there is from then on where one thread alone pushes.
  /// @return false where the queue was closed or `stop` requested first
  bool wait_for_room(const std::stop_token& stop = {}) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, stop, [this] { return items_.size() < capacity_ || closed_; });
    return !closed_ && !stop.stop_requested();
  }

  /// Takes the first item; waits while the queue is empty.
  /// @return nothing where the queue is closed and empty, or `stop` was requested first
  /// @throws what close() was given, once the queue is empty
  std::optional<T> pop(const std::stop_token& stop = {}) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, stop, [this] { return !items_.empty() || closed_; });
    if (stop.stop_requested()) return std::nullopt;
    if (items_.empty()) {
      if (failure_) std::rethrow_exception(failure_);
      return std::nullopt;
    }
    std::optional<T> item(std::move(items_.front()));
    items_.pop_front();
    changed_.notify_all();
    return item;
  }

  /// The first item where there is one now.
  std::optional<T> try_pop() {
    const std::lock_guard lock(mutex_);
    if (items_.empty()) return std::nullopt;
    std::optional<T> item(std::move(items_.front()));
    items_.pop_front();
    changed_.notify_all();
    return item;
  }

  /// So many of the items that pop() gave are worked off.
  void done(std::size_t count = 1) {
    const std::lock_guard lock(mutex_);
    unfinished_ -= std::min(count, unfinished_);
    changed_.notify_all();
  }

  /// Waits until every item that was pushed is done(). @throws what close() was given, at once
  void join() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return unfinished_ == 0 || failure_; });
    if (failure_) std::rethrow_exception(failure_);
  }

  /// Ends the queue: no item is accepted any more, whoever waits goes on. Of several failures the first
  /// counts.
  void close(std::exception_ptr failure = nullptr) {
    const std::lock_guard lock(mutex_);
    closed_ = true;
    if (!failure_) failure_ = std::move(failure);
    changed_.notify_all();
  }

 private:
  const std::size_t capacity_;
  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::deque<T> items_;
  std::size_t unfinished_ = 0;  // pushed and not done
  bool closed_ = false;
  std::exception_ptr failure_;
};

}  // namespace dynslam::runtime

#include "dynslam/pop_macros.hpp"
