# SPDX-License-Identifier: BSD-3-Clause
"""RGB-D SLAM for dynamic scenes.

Lengths are in metres, times in seconds, images (height, width). Arrays are used where they are: the pixels of a row must be
beside each other, and dtypes are those that a function names; anything else is a TypeError or ValueError that says so.
"""
from ._dynslam import (Camera, Frame, InputError, Map, MapCell, MotionResult, MotionSegmenter, Sequence, Slam, StaticWeights,
                       TrackResult, Trajectory, UsageError, __version__, evaluate, load_sequence, static_weights)

__all__ = ["Camera", "Frame", "InputError", "Map", "MapCell", "MotionResult", "MotionSegmenter", "Sequence", "Slam", "StaticWeights",
           "TrackResult", "Trajectory", "UsageError", "evaluate", "load_sequence", "static_weights"]

for _name in __all__:  # as users see them
    globals()[_name].__module__ = __name__
del _name
