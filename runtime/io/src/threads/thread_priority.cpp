// SPDX-License-Identifier: BSD-3-Clause
#include "threads/thread_priority.hpp"

#ifdef __linux__
#include <sys/resource.h>
#include <unistd.h>
#endif

namespace dynslam::runtime {

void step_back([[maybe_unused]] StepBack how) {
#ifdef __linux__  // where priorities belong to threads, not to processes
  (void)setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), how == StepBack::far ? 10 : 5);
#endif
}

}  // namespace dynslam::runtime
