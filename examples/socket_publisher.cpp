// Sends a recorded drive to a graph with `--source socket`; needs nothing but the headers beside it.
//   zcat FRAMES.csv.gz | grep '^3,' | socket_publisher [PORT] [CHANNELS]
// CHANNELS is a file with what `vigil channels --robot F` printed, examples/rover.channels if it is not given.
#include "recording.hpp"

#include <arpa/inet.h>
#include <chrono>
#include <cstdlib>
#include <thread>

int main(int count, char **words) {
  using namespace std::chrono;
  const int to = socket(AF_INET, SOCK_DGRAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(count > 1 ? std::atoi(words[1]) : 7401);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const vigil::Channels channels(count > 2 ? words[2] : "examples/rover.channels");
  std::puts("sending at 20 Hz; scripts/up shows 'alarm' and 'diagnosis' when the wheel sticks");
  auto due = steady_clock::now();
  const uint64_t epoch = due.time_since_epoch().count();
  vigil_sensor_frame frame;
  for (uint64_t seq = 0; next_frame(channels, frame); seq++) {
    std::this_thread::sleep_until(due += milliseconds(50));
    frame.header.epoch = epoch, frame.header.seq = seq;
    uint8_t bytes[VIGIL_DATAGRAM_SIZE];
    vigil_datagram(&frame, bytes);
    sendto(to, bytes, sizeof bytes, 0, reinterpret_cast<sockaddr *>(&address), sizeof address);
  }
}
