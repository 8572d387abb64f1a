// SPDX-License-Identifier: BSD-3-Clause
#include "io/process_memory.hpp"

#include <sys/resource.h>
#include <unistd.h>

#include <fstream>

namespace dynslam::runtime {

double rss_mb() {
  std::ifstream in("/proc/self/statm");
  double size = 0, resident = 0;  // pages
  in >> size >> resident;
  return in ? resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1048576.0 : 0.0;
}

double peak_rss_mb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

}  // namespace dynslam::runtime
