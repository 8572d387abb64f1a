// SPDX-License-Identifier: BSD-3-Clause
// What Debian's librosbag-storage makes of a bag, in a program of its own:
//
//   rosbag_oracle list IN                          topic, type, size and check sum of every message
//   rosbag_oracle copy IN OUT none|bz2|lz4 BYTES   the same messages, written by its writer in chunks of so
//   many
#include <rosbag/bag.h>
#include <rosbag/view.h>

#include <cstdint>
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

namespace {

int list(const std::string& in) {
  const rosbag::Bag bag(in, rosbag::bagmode::Read);
  rosbag::View view(bag);
  for (const rosbag::MessageInstance& message : view) {
    std::vector<std::uint8_t> bytes(message.size());
    ros::serialization::OStream stream(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
    message.write(stream);
    std::uint32_t sum = 0;
    for (const std::uint8_t byte : bytes) sum = 31 * sum + byte;
    std::printf("%s %s %zu %u\n", message.getTopic().c_str(), message.getDataType().c_str(), bytes.size(),
                unsigned(sum));
  }
  return 0;
}

int copy(const std::string& in, const std::string& out, const std::string& compression, unsigned chunk) {
  const rosbag::Bag from(in, rosbag::bagmode::Read);
  rosbag::Bag to(out, rosbag::bagmode::Write);
  to.setChunkThreshold(chunk);
  to.setCompression(compression == "bz2"   ? rosbag::compression::BZ2
                    : compression == "lz4" ? rosbag::compression::LZ4
                                           : rosbag::compression::Uncompressed);
  rosbag::View view(from);
  for (const rosbag::MessageInstance& message : view)
    to.write(message.getTopic(), message.getTime(), message, message.getConnectionHeader());
  to.close();
  return 0;
}

}  // namespace

int main(int argc, char** argv) try {
  const std::vector<std::string> words(argv + 1, argv + argc);
  if (words.size() == 2 && words[0] == "list") return list(words[1]);
  if (words.size() == 5 && words[0] == "copy")
    return copy(words[1], words[2], words[3], unsigned(std::stoul(words[4])));
  std::fputs("usage: rosbag_oracle list IN | copy IN OUT none|bz2|lz4 BYTES\n", stderr);
  return 2;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
