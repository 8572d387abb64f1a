#include "dynslam/geometry/epipolar.hpp"
