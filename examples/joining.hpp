// Joins a running graph through shared memory; waits until there is one. Version 0.10.0 of iceoryx2's C++ binding.
#pragma once
#include "channels.hpp"
#include "vigil_types.h"

#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iox2/iceoryx2.hpp>
#include <string>
#include <sys/stat.h>
#include <thread>
#include <type_traits>
#include <unistd.h>
#include <utility>
#include <vector>

IOX2_DEFINE_TYPE_NAME(vigil_sensor_frame, VIGIL_SENSOR_FRAME_TYPE_NAME);
IOX2_DEFINE_TYPE_NAME(vigil_action, VIGIL_ACTION_TYPE_NAME);

namespace vigil {

using Node = iox2::Node<iox2::ServiceType::Ipc>;

inline void wait_a_little() { std::this_thread::sleep_for(std::chrono::milliseconds(100)); }

// Folder of the running graph of this name; empty while there is none: the graph cleans up what joins before it.
inline std::string runtime_folder(const std::string &graph) {
  auto variable = [](const char *name) {
    const char *value = std::getenv(name);
    return std::string(value ? value : "");
  };
  const std::string user = variable("XDG_RUNTIME_DIR"), temporary = variable("TMPDIR");
  std::vector<std::string> folders = {"/run/vigil"};
  if (!user.empty()) folders.push_back(user + "/vigil");
  folders.push_back((temporary.empty() ? "/tmp" : temporary) + "/vigil-" + std::to_string(getuid()));
  std::string closed;
  for (const std::string &folder : folders) {
    struct stat found;
    if (stat((folder + "/" + graph + "/processes").c_str(), &found) == 0) return folder + "/" + graph;
    if (errno == EACCES) closed = folder;
  }
  if (!closed.empty()) fail("no graph '" + graph + "' of yours is running, and " + closed + " is another user's");
  return "";
}

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

// What `open` returns once the graph has made it; ends the program, and says why, if it never will.
template <typename Open>
auto wait_for(const std::string &graph, Open open) {
  for (bool is_first = true;; is_first = false) {
    auto opened = open();
    if (opened.has_value()) return std::move(opened.value());
    const std::string folder = runtime_folder(graph);
    if (folder.empty()) fail("the graph '" + graph + "' has ended");
    if (!is_coming(opened.error())) fail(explain(opened.error(), folder));
    const char *error = iox2::bb::into<const char *>(opened.error());
    if (is_first) std::fprintf(stderr, "waiting for the graph's topics: %s\n", error);
    wait_a_little();
  }
}

// A node in the running graph of this name; waits for it.
inline Node join(const std::string &graph) {
  std::string folder = runtime_folder(graph);
  if (folder.empty()) std::fprintf(stderr, "waiting for a graph named '%s'\n", graph.c_str());
  for (; folder.empty(); folder = runtime_folder(graph)) wait_a_little();
  iox2::Config config;
  config.global().set_prefix(iox2::bb::FileName::create(("vigil_" + graph + "_").c_str()).value());
  config.global().set_root_path(iox2::bb::Path::create((folder + "/t").c_str()).value());
  return wait_for(graph, [&] { return iox2::NodeBuilder().config(config).create<iox2::ServiceType::Ipc>(); });
}

// Channel list of a graph that was joined.
inline Channels channel_list(const std::string &graph) { return Channels(runtime_folder(graph) + "/channels"); }

// Builder of a topic of the graph: "sensor", "action".
inline auto topic(const Node &node, const std::string &graph, const char *name) {
  const std::string full = "vigil/" + graph + "/" + name;
  return node.service_builder(iox2::ServiceName::create(full.c_str()).value());
}

}  // namespace vigil
