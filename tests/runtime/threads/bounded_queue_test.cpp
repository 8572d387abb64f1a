// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/threads/bounded_queue.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <memory>
#include <numeric>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "random.hpp"

using dynslam::runtime::BoundedQueue;

namespace {

std::exception_ptr failure(const char* what) {
  return std::make_exception_ptr(std::runtime_error(what));
}

void pause_at_times(dynslam::test::Rng& rng) {
  if (rng.chance(0.02)) std::this_thread::sleep_for(std::chrono::microseconds(rng.integer(1, 200)));
}

}  // namespace

TEST_CASE("one producer, one consumer: every item once, in order, never more than the capacity waiting") {
  for (const std::size_t capacity : {0U, 1U, 3U, 64U}) {  // 0 is taken as 1
    constexpr int kItems = 20000;
    BoundedQueue<std::unique_ptr<int>> queue(capacity);  // items that can only be moved
    std::atomic<int> pushed{0}, popped{0}, most{0};
    std::jthread producer([&] {
      dynslam::test::Rng rng("bounded queue producer");
      for (int i = 0; i < kItems; ++i) {
        queue.push(std::make_unique<int>(i));
        ++pushed;
        pause_at_times(rng);
      }
      queue.close();
    });
    dynslam::test::Rng rng("bounded queue consumer");
    int expected = 0;
    bool in_order = true;
    while (const auto item = queue.pop()) {
      in_order = in_order && **item == expected++;
      most = std::max(most.load(), pushed.load() - popped.load());
      ++popped;
      pause_at_times(rng);
    }
    CHECK(in_order);
    CHECK(expected == kItems);
    CHECK(most <= static_cast<int>(std::max<std::size_t>(1, capacity)) + 1);  // and the one in hand
    CHECK_FALSE(queue.pop());
    CHECK_FALSE(queue.push(nullptr));
  }
}

TEST_CASE("many producers and consumers: nothing lost, nothing twice, join() waits for the last done()") {
  constexpr int kProducers = 4, kConsumers = 3, kItems = 3000;
  BoundedQueue<int> queue(5);
  std::vector<std::atomic<int>> seen(kProducers * kItems);
  std::atomic<int> finished{0};
  std::vector<std::jthread> consumers;
  for (int c = 0; c < kConsumers; ++c) {
    consumers.emplace_back([&](const std::stop_token& stop) {
      while (const auto item = queue.pop(stop)) {
        ++seen[static_cast<std::size_t>(*item)];
        ++finished;
        queue.done();
      }
    });
  }
  {
    std::vector<std::jthread> producers;
    for (int p = 0; p < kProducers; ++p) {
      producers.emplace_back([&, p] {
        for (int i = 0; i < kItems; ++i) queue.push(p * kItems + i);
      });
    }
  }
  queue.join();
  CHECK(finished == kProducers * kItems);
  CHECK(std::all_of(seen.begin(), seen.end(), [](const auto& n) { return n == 1; }));
}  // the consumers are stopped while they wait

TEST_CASE("a producer's failure comes after the items before it, and stays") {
  BoundedQueue<int> queue(4);
  std::jthread producer([&] {
    for (int i = 0; i < 10; ++i) queue.push(i);
    queue.close(failure("the image is broken"));
  });
  for (int i = 0; i < 10; ++i) CHECK(queue.pop() == i);
  CHECK_THROWS_WITH(queue.pop(), "the image is broken");
  CHECK_THROWS_WITH(queue.pop(), "the image is broken");
  queue.close(failure("a later one"));
  CHECK_THROWS_WITH(queue.push(1), "the image is broken");
}

TEST_CASE("a consumer's failure reaches whoever waits to push and whoever joins") {
  BoundedQueue<int> queue(1);
  std::atomic<int> thrown{0};
  std::vector<std::jthread> others;
  queue.push(0);
  for (int k = 0; k < 3; ++k) {
    others.emplace_back([&] {
      try {
        queue.push(1);
        queue.push(2);
      } catch (const std::runtime_error&) {
        ++thrown;
      }
    });
    others.emplace_back([&] {
      try {
        queue.join();
      } catch (const std::runtime_error&) {
        ++thrown;
      }
    });
  }
  CHECK(queue.pop() == 0);
  std::this_thread::sleep_for(std::chrono::milliseconds(5));
  queue.close(failure("no room on the disk"));
  others.clear();
  CHECK(thrown == 6);
}

TEST_CASE("try_pop() does not wait, and several items can be done at once") {
  BoundedQueue<int> queue(2);
  CHECK_FALSE(queue.try_pop());
  queue.push(1);
  queue.push(2);
  std::jthread producer([&] { queue.push(3); });  // waits for room
  CHECK(queue.try_pop() == 1);
  producer.join();
  CHECK(queue.try_pop() == 2);
  CHECK(queue.try_pop() == 3);
  CHECK_FALSE(queue.try_pop());
  std::atomic<bool> joined{false};
  {
    const std::jthread other([&] {
      queue.join();
      joined = true;
    });
    queue.done(2);
    CHECK_FALSE(joined);
    queue.done();
  }
  CHECK(joined);
}

TEST_CASE("a stop request wakes who waits for room and who waits for an item") {
  for (int trial = 0; trial < 200; ++trial) {
    BoundedQueue<int> full(1), empty(1);
    full.push(1);
    std::atomic<int> woken{0};
    {
      const std::jthread pusher([&](const std::stop_token& stop) {
        if (!full.push(2, stop)) ++woken;
      });
      const std::jthread popper([&](const std::stop_token& stop) {
        if (!empty.pop(stop)) ++woken;
      });
      if (trial % 2 == 0) std::this_thread::yield();
    }  // both are asked to stop, before or while they wait
    CHECK(woken == 2);
    CHECK(full.pop() == 1);
  }
}

TEST_CASE("push_newest() never waits: the first item makes room, and what is dropped comes back") {
  BoundedQueue<int> queue(3);
  std::vector<int> dropped;
  for (int i = 0; i < 7; ++i) {
    if (const auto gone = queue.push_newest(i)) dropped.push_back(*gone);
  }
  CHECK(dropped == std::vector<int>{0, 1, 2, 3});
  for (int i = 4; i < 7; ++i) {
    CHECK(queue.pop() == i);
    queue.done();
  }
  queue.join();  // those that were dropped are not waited for
  queue.close();
  CHECK(queue.push_newest(7) == 7);
  BoundedQueue<int> failed(1);
  failed.close(failure("no"));
  CHECK_THROWS_WITH_AS((void)failed.push_newest(1), "no", std::runtime_error);
}

TEST_CASE("wait_for_room() returns when a push would not wait, and when there will never be room") {
  BoundedQueue<int> queue(1);
  CHECK(queue.wait_for_room());
  queue.push(1);
  std::atomic<bool> room{false};
  {
    std::jthread waiting([&] { room = queue.wait_for_room(); });
    CHECK(queue.pop() == 1);
  }
  CHECK(room);
  queue.push(2);
  {
    std::jthread waiting([&] { room = queue.wait_for_room(); });
    queue.close();
  }
  CHECK_FALSE(room);
  BoundedQueue<int> full(1);
  full.push(1);
  {
    std::jthread waiting([&](const std::stop_token& stop) { room = full.wait_for_room(stop); });
    waiting.request_stop();
  }
  CHECK_FALSE(room);
}
