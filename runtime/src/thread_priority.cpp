// SPDX-License-Identifier: BSD-3-Clause
#include "thread_priority.hpp"

#ifdef __linux__
#include <sched.h>
#include <sys/resource.h>
#include <unistd.h>
#endif

namespace dynslam::runtime {

void step_back([[maybe_unused]] StepBack how) {
#ifdef __linux__  // where priorities belong to threads, not to processes
  if (how == StepBack::fully) {
    const sched_param any{};
    (void)sched_setscheduler(0, SCHED_IDLE, &any);
  } else {
    constexpr int kNice = 5;
    (void)setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), kNice);
  }
#endif
}

}  // namespace dynslam::runtime
