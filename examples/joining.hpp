// Publishes into a graph through shared memory; waits for it aloud, and joins it again after a restart. Version 0.10.0
// of iceoryx2's C++ binding.
#pragma once
#include "vigil_types.h"
#include "waiting.hpp"

#include <fstream>
#include <iox2/iceoryx2.hpp>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>

IOX2_DEFINE_TYPE_NAME(vigil_sensor_frame, VIGIL_SENSOR_FRAME_TYPE_NAME);
IOX2_DEFINE_TYPE_NAME(vigil_action, VIGIL_ACTION_TYPE_NAME);

namespace vigil {

using Node = iox2::Node<iox2::ServiceType::Ipc>;

// What is different between a running graph's types and ours: a sentence.
inline std::string difference(const std::string &folder) {
  struct Type {
    std::string name;
    size_t size, alignment;
    std::string words() const {
      return name + ", " + std::to_string(size) + " bytes, alignment " + std::to_string(alignment);
    }
    // Without version and hash: vigil.SensorFrame.
    std::string block() const { return name.substr(0, name.find('.', name.find('.') + 1)); }
  };
  const Type ours[] = {{VIGIL_SENSOR_FRAME_TYPE_NAME, sizeof(vigil_sensor_frame), alignof(vigil_sensor_frame)},
                       {VIGIL_ACTION_TYPE_NAME, sizeof(vigil_action), alignof(vigil_action)}};
  std::ifstream file(folder + "/types");
  std::string version = "of an unknown version";
  for (Type theirs; file >> theirs.name >> theirs.size >> theirs.alignment >> version;)
    for (const Type &own : ours)
      if (own.block() == theirs.block() && own.words() != theirs.words())
        return "the graph has " + theirs.words() + " (iceoryx2 " + version + "); this program has " + own.words() +
               ": make vigil_types.h anew with 'vigil types c'";
  return "the types are the same; the graph has iceoryx2 " + version + ", and this program must have the same";
}

// True if it is not there yet, or just being made.
template <typename Error>
constexpr bool is_coming([[maybe_unused]] Error error) {
  if constexpr (std::is_same_v<Error, iox2::PublishSubscribeOpenError> || std::is_same_v<Error, iox2::EventOpenError>)
    return error == Error::DoesNotExist || error == Error::HangsInCreation ||
           error == Error::IsMarkedForDestruction || error == Error::ServiceInCorruptedState;
  else
    return false;
}

// What to say of another error.
template <typename Error>
std::string explain(Error error, const std::string &folder) {
  const std::string text = iox2::bb::into<const char *>(error);
  if constexpr (std::is_same_v<Error, iox2::PublisherCreateError>)
    if (error == Error::ExceedsMaxSupportedPublishers)
      return text + ": a publisher is connected, and the graph admits one";
  return text + ": " + difference(folder);
}

// Builder of a topic of the graph: "sensor", "action".
inline auto topic(const Node &node, const std::string &graph, const char *name) {
  const std::string full = "vigil/" + graph + "/" + name;
  return node.service_builder(iox2::ServiceName::create(full.c_str()).value());
}

// Publishes the frames of a robot into the graph of this name. Ends the program, and says why, if no waiting helps: if
// the graph has other types, or a publisher.
class Publisher {
 public:
  // Waits for the graph.
  explicit Publisher(const std::string &graph) : waiting(graph) {
    // Its warnings are about files that the graph has just cleaned up.
    iox2::set_log_level(iox2::LogLevel::Error);
    while (!try_to_join()) wait_a_little();
  }

  // The channel list, which sets values by their names.
  const Channels &channels() const { return *list; }

  // Fills in the header and sends the frame, which was due then; false if there is no graph to take it. It never waits:
  // if the graph has ended it says so, and joins the next one. A capture time of 0 becomes `due`.
  bool publish(vigil_sensor_frame frame, std::chrono::steady_clock::time_point due = std::chrono::steady_clock::now()) {
    using namespace std::chrono;
    if (steady_clock::now() >= look && !is_joined()) {
      joined.reset();
      if (!try_to_join()) return false;
    }
    if (!joined) return false;
    vigil_header &header = frame.header;
    header.schema = VIGIL_SENSOR_FRAME_SCHEMA, header.epoch = epoch, header.seq = seq;
    header.t_schedule_ns = due.time_since_epoch().count();
    if (header.t_capture_ns == 0) header.t_capture_ns = header.t_schedule_ns;
    header.t_publish_ns = steady_clock::now().time_since_epoch().count();
    auto sample = joined->frames.loan_uninit();
    if (sample.has_value() && iox2::send(sample.value().write_payload(std::move(frame))).has_value() &&
        joined->bell.notify().has_value()) {
      seq++;
      return true;
    }
    // Between two looks the graph may have taken its files away.
    if (is_joined()) fail("graph '" + waiting.graph + "': the transport refuses a frame");
    return false;
  }

 private:
  // Ports of one start of the graph; they go before their node.
  struct Joined {
    Node node;
    iox2::Publisher<iox2::ServiceType::Ipc, vigil_sensor_frame, void> frames;
    iox2::Notifier<iox2::ServiceType::Ipc> bell;
  };
  Waiting waiting;
  std::unique_ptr<Joined> joined;
  std::unique_ptr<Channels> list;
  std::string start;
  std::chrono::steady_clock::time_point look;
  uint64_t epoch = 0, seq = 0;

  bool is_joined() {
    look = std::chrono::steady_clock::now() + std::chrono::milliseconds(200);
    return joined && graph_start(runtime_folder(waiting.graph)) == start;
  }

  // True if `opened` is an error to wait after; ends the program if it is one of another kind.
  template <typename Opened>
  bool is_missing(const Opened &opened, const std::string &folder) {
    if (opened.has_value()) return false;
    // Of a graph that has ended meanwhile nothing can be said.
    if (!is_coming(opened.error()) && graph_start(folder) == start) fail(explain(opened.error(), folder));
    waiting.tell("the topics of graph '" + waiting.graph + "'");
    return true;
  }

  bool try_to_join() {
    const std::string folder = runtime_folder(waiting.graph), graph = waiting.graph;
    start = graph_start(folder);
    if (start.empty()) {
      waiting.tell();
      return false;
    }
    // Each start of a graph has files of its own names.
    std::string prefix;
    std::ifstream(folder + "/start") >> prefix;
    prefix = "vigil_" + graph + "_" + prefix;
    iox2::Config config;
    config.global().set_prefix(iox2::bb::FileName::create(prefix.c_str()).value());
    config.global().set_root_path(iox2::bb::Path::create((folder + "/t").c_str()).value());
    auto node = iox2::NodeBuilder().config(config).create<iox2::ServiceType::Ipc>();
    if (is_missing(node, folder)) return false;
    auto frames = topic(node.value(), graph, "sensor").publish_subscribe<vigil_sensor_frame>().open();
    if (is_missing(frames, folder)) return false;
    auto bells = topic(node.value(), graph, "sensor").event().open();
    if (is_missing(bells, folder)) return false;
    auto publisher = frames.value().publisher_builder().create();
    if (is_missing(publisher, folder)) return false;
    auto bell = bells.value().notifier_builder().create();
    if (is_missing(bell, folder)) return false;
    list = std::make_unique<Channels>(folder + "/channels");
    joined = std::unique_ptr<Joined>(
        new Joined{std::move(node.value()), std::move(publisher.value()), std::move(bell.value())});
    epoch = std::chrono::steady_clock::now().time_since_epoch().count(), seq = 0;
    look = std::chrono::steady_clock::now() + std::chrono::milliseconds(200);
    waiting.end();
    return true;
  }
};

}  // namespace vigil
