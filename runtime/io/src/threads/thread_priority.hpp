// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace dynslam::runtime {

/// How far the calling thread steps back. Where cores are few the tracker, whose time is a frame's latency,
/// goes first; no other thread can starve for good, as the tracker waits for what each of them makes.
enum class StepBack {
  some,  ///< decoding, mapping, bundle adjustment: a third of the tracker's share where both want the core
  far    ///< the network: a tenth. (The idle class would stop it, and the run, beside a busy program.)
};

/// Changes the calling thread's priority. A refusal by the system costs speed and nothing else.
void step_back(StepBack how);

}  // namespace dynslam::runtime
