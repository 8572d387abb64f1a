// SPDX-License-Identifier: BSD-3-Clause
#include "dynslam/runtime/slam/map_scan.hpp"

#include "io/binary_file.hpp"

namespace dynslam::runtime {

void write_scan(BinaryWriter& out, const MapScan& scan) {
  out.put(scan.depth);
  out.put(scan.code);
  out.put(scan.rgb);
}

MapScan read_scan(BinaryReader& in, std::size_t samples) {
  MapScan scan;
  in.get(scan.depth);
  in.get(scan.code);
  in.get(scan.rgb);
  in.require(scan.depth.size() == samples && scan.code.size() == samples, "holds scans of another camera");
  in.require(scan.consistent(), "holds a scan that cannot be");
  return scan;
}

}  // namespace dynslam::runtime
