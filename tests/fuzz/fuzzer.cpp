// SPDX-License-Identifier: BSD-3-Clause
// libFuzzer's entry to the target that DYNSLAM_FUZZ_TARGET names; with DYNSLAM_FUZZ_SEEDS the seeds of all
// targets are written below that folder instead. See scripts/fuzz.sh.
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "targets.hpp"

namespace {

dynslam::fuzz::Target chosen() {
  const char* name = std::getenv("DYNSLAM_FUZZ_TARGET");
  for (const auto& target : dynslam::fuzz::targets()) {
    if (name != nullptr && target.name == name) return target;
  }
  std::fputs("DYNSLAM_FUZZ_TARGET names no target\n", stderr);
  std::exit(2);
}

}  // namespace

extern "C" int LLVMFuzzerInitialize(int*, char***) {
  const char* folder = std::getenv("DYNSLAM_FUZZ_SEEDS");
  if (folder == nullptr) return 0;
  for (const auto& target : dynslam::fuzz::targets()) {
    const auto path = std::filesystem::path(folder) / target.name;
    std::filesystem::create_directories(path);
    int n = 0;
    for (const std::string& seed : target.seeds())
      std::ofstream(path / ("seed" + std::to_string(n++)), std::ios::binary) << seed;
    std::printf("%s\n", std::string(target.name).c_str());
  }
  std::exit(0);
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const dynslam::fuzz::Target target = chosen();
  target.run({data, size});
  return 0;
}
