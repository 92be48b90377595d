// Frames of a recording of the rover: one run's rows of tests/data/rover on standard input.
#pragma once
#include "vigil_types.h"

#include <cmath>
#include <cstdio>

// The next row as a frame; false at the end.
inline bool next_frame(vigil_sensor_frame &frame) {
  const int steered[4] = {0, 2, 3, 5};  // LF, LR, RF, RR of LF LM LR RF RM RR
  double run, t;
  frame = vigil_sensor_frame{};
  int read = std::scanf("%lf,%lf", &run, &t);
  for (double &value : frame.pose) read += std::scanf(",%lf", &value);
  for (int i = 0; i < 6; i++) read += std::scanf(",%lf", &frame.wheel_rate[i]);
  for (int i : steered) read += std::scanf(",%lf", &frame.steer[i]);
  read += std::scanf(",%lf,%lf", &frame.command[0], &frame.command[1]);
  if (read != 17) return false;
  // What is measured is marked, what is not stays 0.
  frame.valid = VIGIL_VALID_POSE | 3 * VIGIL_VALID_COMMAND_0 | 0x3f * VIGIL_VALID_WHEEL_RATE_0;
  for (int i : steered) frame.valid |= uint64_t(VIGIL_VALID_STEER_0) << i;
  frame.run_id = 1 + uint64_t(run);
  frame.header.schema = VIGIL_SENSOR_FRAME_SCHEMA;
  frame.header.t_capture_ns = uint64_t(std::llround(t * 1e9));
  return true;
}
