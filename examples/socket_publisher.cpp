// Sends a recorded drive to a graph with `--source socket`; needs nothing but the headers beside it.
//   zcat FRAMES.csv.gz | grep '^3,' | socket_publisher [GRAPH] [HZ] [CHANNELS]
// GRAPH: the graph's name; or host:port of its UDP socket, or the path of its Unix socket. CHANNELS: with an address,
// the file with what `vigil channels --robot F` printed; examples/rover.channels if it is not given.
#include "recording.hpp"
#include "sending.hpp"

int main(int count, char **words) {
  using namespace std::chrono;
  vigil::SocketPublisher publisher(count > 1 ? words[1] : "rover", count > 3 ? words[3] : "examples/rover.channels");
  const auto period = vigil::period_of(count > 2 ? words[2] : "20");
  std::puts("sending; scripts/up shows 'alarm' and 'diagnosis' when the wheel sticks");
  auto due = steady_clock::now();
  vigil_sensor_frame frame;
  vigil_verdict verdict{};
  std::string said;
  while (next_frame(publisher.channels(), frame)) {
    std::this_thread::sleep_until(due += period);
    publisher.publish(frame);
    // A robot would do as the newest one says: see docs/external-sensor.md.
    if (!publisher.verdict(verdict)) continue;
    const std::string now = std::string(verdict.action_name) + ", " + verdict.mode_name;
    if (now != said) std::printf("%s p=%.3f\n", now.c_str(), verdict.p_mode);
    said = now;
  }
}
