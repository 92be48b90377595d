// Sends a recorded drive to a graph with `--source socket`. Rows of tests/data/rover on standard input:
//   c++ -std=c++17 publisher.cpp -o publisher && zcat FRAMES.csv.gz | grep '^3,' | ./publisher [PORT]
#include "vigil_types.h"

#include <arpa/inet.h>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <thread>

int main(int count, char **words) {
  using namespace std::chrono;
  const int to = socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(count > 1 ? std::atoi(words[1]) : 7401);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const int steered[4] = {0, 2, 3, 5};  // LF, LR, RF, RR of LF LM LR RF RM RR
  std::puts("sending at 20 Hz; scripts/up shows 'alarm' and 'diagnosis' when the wheel sticks");
  auto due = steady_clock::now();
  const uint64_t epoch = due.time_since_epoch().count();
  double run, t;
  for (uint64_t seq = 0; std::scanf("%lf,%lf", &run, &t) == 2; seq++) {
    vigil_sensor_frame frame{};
    for (double &value : frame.pose) std::scanf(",%lf", &value);
    for (int i = 0; i < 6; i++) std::scanf(",%lf", &frame.wheel_rate[i]);
    for (int i : steered) std::scanf(",%lf", &frame.steer[i]), frame.valid |= uint64_t(VIGIL_VALID_STEER_0) << i;
    std::scanf(",%lf,%lf", &frame.command[0], &frame.command[1]);
    frame.valid |= VIGIL_VALID_POSE | 3 * VIGIL_VALID_COMMAND_0 | 0x3f * VIGIL_VALID_WHEEL_RATE_0;
    frame.run_id = 1 + uint64_t(run);
    frame.header.epoch = epoch, frame.header.seq = seq;
    frame.header.t_capture_ns = uint64_t(std::llround(t * 1e9));
    uint8_t bytes[VIGIL_DATAGRAM_SIZE];
    vigil_datagram(&frame, bytes);
    std::this_thread::sleep_until(due += milliseconds(50));
    sendto(to, bytes, sizeof bytes, 0, reinterpret_cast<sockaddr *>(&address), sizeof address);
  }
}
