// Publishes a recorded drive into a running graph, through shared memory:
//   zcat FRAMES.csv.gz | grep '^3,' | publisher [GRAPH] [HZ], after `scripts/up --source external --rate 20`.
#include "joining.hpp"
#include "recording.hpp"

int main(int count, char **words) {
  using namespace std::chrono;
  vigil::Publisher publisher(count > 1 ? words[1] : "rover");
  const auto period = vigil::period_of(count > 2 ? words[2] : "20");
  std::puts("publishing; scripts/up shows 'alarm' and 'diagnosis' when the wheel sticks");
  auto due = steady_clock::now();  // CLOCK_MONOTONIC
  vigil_sensor_frame frame;
  while (next_frame(publisher.channels(), frame)) {
    std::this_thread::sleep_until(due += period);
    publisher.publish(frame, due);
  }
}
