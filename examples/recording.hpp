// Frames of a recording of the rover: one run's rows of tests/data/rover on standard input.
#pragma once
#include "channels.hpp"

#include <chrono>
#include <cmath>

namespace vigil {

// Time between two frames at this many Hz.
inline std::chrono::nanoseconds period_of(const char *hz) {
  const double rate = std::atof(hz);
  if (!(rate > 0.001 && rate < 1e6)) fail(std::string(hz) + ": no rate in Hz");
  return std::chrono::nanoseconds(std::llround(1e9 / rate));
}

}  // namespace vigil

// The next row as a frame; false at the end.
inline bool next_frame(const vigil::Channels &channels, vigil_sensor_frame &frame) {
  const char *const measured[] = {"x",      "y",      "yaw",    "enc_LF",   "enc_LM",   "enc_LR",  "enc_RF",
                                  "enc_RM", "enc_RR", "steer_LF", "steer_LR", "steer_RF", "steer_RR"};
  double run, t, value;
  frame = vigil_sensor_frame{};
  if (std::scanf("%lf,%lf", &run, &t) != 2) return false;
  // What is measured is set by its name, what is not stays 0.
  for (const char *name : measured) {
    if (std::scanf(",%lf", &value) != 1) return false;
    channels.set(frame, name, value);
  }
  for (const char *axis : {"cmd_curv", "cmd_speed"}) {
    if (std::scanf(",%lf", &value) != 1) return false;
    channels.command(frame, axis, value);
  }
  frame.run_id = 1 + uint64_t(run);
  frame.header.schema = VIGIL_SENSOR_FRAME_SCHEMA;
  // From 1 on: a capture time of 0 is none.
  frame.header.t_capture_ns = 1 + uint64_t(std::llround(t * 1e9));
  return true;
}
