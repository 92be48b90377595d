// Publishes a recorded drive into a running graph, through shared memory:
//   zcat FRAMES.csv.gz | grep '^3,' | publisher [GRAPH], after `scripts/up --source external --rate 20`.
// GRAPH is the graph's name, rover if it is not given.
#include "joining.hpp"
#include "recording.hpp"

int main(int count, char **words) {
  using namespace std::chrono;
  const std::string graph = count > 1 ? words[1] : "rover";
  const auto node = vigil::join(graph);
  auto sensor = [&] { return vigil::topic(node, graph, "sensor"); };
  auto frames = vigil::wait_for(graph, [&] { return sensor().publish_subscribe<vigil_sensor_frame>().open(); });
  auto bells = vigil::wait_for(graph, [&] { return sensor().event().open(); });
  auto publisher = vigil::wait_for(graph, [&] { return frames.publisher_builder().create(); });
  auto bell = vigil::wait_for(graph, [&] { return bells.notifier_builder().create(); });
  const vigil::Channels channels = vigil::channel_list(graph);
  std::puts("publishing at 20 Hz; scripts/up shows 'alarm' and 'diagnosis' when the wheel sticks");
  auto due = steady_clock::now();  // CLOCK_MONOTONIC
  const uint64_t epoch = due.time_since_epoch().count();
  vigil_sensor_frame frame;
  for (uint64_t seq = 0; next_frame(channels, frame); seq++) {
    std::this_thread::sleep_until(due += milliseconds(50));
    frame.header.epoch = epoch, frame.header.seq = seq;
    frame.header.t_schedule_ns = due.time_since_epoch().count();
    frame.header.t_publish_ns = steady_clock::now().time_since_epoch().count();
    iox2::send(publisher.loan_uninit().value().write_payload(vigil_sensor_frame(frame))).value();
    bell.notify().value();  // wakes its readers
  }
}
