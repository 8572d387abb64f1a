// SPDX-License-Identifier: BSD-3-Clause
#include "io/process_memory.hpp"

#include <fcntl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <system_error>

#include "io/file_handle.hpp"

namespace dynslam::runtime {

/// Asked after each frame: the file stays open, whose text is made anew for who reads it from its beginning.
double rss_mb() {
  static const FileHandle file(::open("/proc/self/statm", O_RDONLY | O_CLOEXEC));
  std::array<char, 128> text;
  char* const begin = text.data();
  const auto length = ::pread(file.get(), begin, text.size(), 0);
  if (length <= 0) return 0.0;
  char* const end = begin + length;
  char* second = std::find(begin, end, ' ');
  if (second != end) ++second;
  unsigned long long resident = 0;  // pages
  if (std::from_chars(second, end, resident).ec != std::errc()) return 0.0;
  return static_cast<double>(resident) * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1048576.0;
}

double peak_rss_mb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

}  // namespace dynslam::runtime
