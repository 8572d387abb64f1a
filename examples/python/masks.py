# SPDX-License-Identifier: BSD-3-Clause
# Masks of what moves for a SLAM system in Python: python3 masks.py SEQUENCE
import sys

import dynslam
import numpy as np

sequence = dynslam.load_sequence(sys.argv[1])  # or images of yours
segmenter = dynslam.MotionSegmenter(sequence.camera)
T_c_w = np.eye(4)
for frame in sequence:
    # Your system tracks here; the example takes the segmenter's own pose, predicted to be the last one.
    T_c_w, found = segmenter.locate(frame.gray, frame.depth, T_c_w)
    motion = segmenter.segment(frame.gray, frame.depth, frame.t, T_c_w)
    # Drop features where motion.mask is not 0, and track again.
    segmenter.remember(T_c_w, motion.mask)
    print(f"{frame.stamp} {motion.status}: {100 * np.count_nonzero(motion.mask) / motion.mask.size:.1f} % moves")
