// Sends frames as datagrams to a graph with `--source socket`, and hears its verdicts.
#pragma once
#include "waiting.hpp"

#include <cstring>
#include <memory>
#include <netdb.h>
#include <sys/socket.h>
#include <sys/un.h>

namespace vigil {

// Sends the frames of a robot to a graph: to the one of this name on this machine, or to an address, host:port of its
// UDP socket or the path of its Unix socket. With an address, `channels` is the file of the channel list.
class SocketPublisher {
 public:
  // Waits for a graph that is named.
  explicit SocketPublisher(const std::string &to, const std::string &channels = "examples/rover.channels")
      : is_name(to.find_first_of("/:") == std::string::npos), waiting(to) {
    if (!is_name) {
      list = std::make_unique<Channels>(channels);
      aim(to);
    } else {
      while (!find_graph()) wait_a_little();
    }
  }
  SocketPublisher(const SocketPublisher &) = delete;
  ~SocketPublisher() { forget(); }

  // The channel list, which sets values by their names.
  const Channels &channels() const { return *list; }

  // Fills in the header and sends the frame; false if nobody listens. It never waits: it says so, and goes on by
  // itself when somebody listens. A capture time of 0 becomes now; the due time is left to the graph.
  bool publish(vigil_sensor_frame frame) {
    const auto now = std::chrono::steady_clock::now();  // CLOCK_MONOTONIC
    if (is_name && now >= look && !find_graph()) return false;
    if (sender < 0) return false;
    frame.header.epoch = epoch, frame.header.seq = seq++;
    frame.header.t_schedule_ns = frame.header.t_publish_ns = 0;
    if (frame.header.t_capture_ns == 0) frame.header.t_capture_ns = now.time_since_epoch().count();
    uint8_t bytes[VIGIL_DATAGRAM_SIZE];
    vigil_datagram(&frame, bytes);
    // Connected each time anew: a Unix socket that was made again is another one. A full queue holds up no robot.
    if (connect(sender, reinterpret_cast<sockaddr *>(&address), length) != 0 ||
        send(sender, bytes, sizeof bytes, MSG_DONTWAIT | MSG_NOSIGNAL) < 0) {
      waiting.tell("a graph at " + aimed + " (" + std::strerror(errno) + ")");
      return false;
    }
    waiting.end();
    return true;
  }

  // The newest verdict that has arrived since the last call; false if none has. It never waits. The robot obeys it for
  // verdict.valid_for_ns from now, and stops after that.
  bool verdict(vigil_verdict &verdict) const {
    bool is_new = false;
    uint8_t bytes[VIGIL_VERDICT_DATAGRAM_SIZE + 1];
    while (sender >= 0) {
      const ssize_t count = recv(sender, bytes, sizeof bytes, MSG_DONTWAIT);
      // Nobody listens where the last frame went; `publish` says so.
      if (count < 0 && errno == ECONNREFUSED) continue;
      if (count < 0) break;
      if (vigil_take_verdict(bytes, static_cast<size_t>(count), &verdict)) is_new = true;
    }
    return is_new;
  }

 private:
  const bool is_name;
  Waiting waiting;
  std::unique_ptr<Channels> list;
  std::string start, aimed;
  std::chrono::steady_clock::time_point look;
  int sender = -1;
  sockaddr_storage address{};
  socklen_t length = 0;
  uint64_t epoch = 0, seq = 0;

  void forget() {
    if (sender >= 0) close(sender);
    sender = -1, start.clear();
  }

  // Looks for the graph of this name; takes the address of the one that there is.
  bool find_graph() {
    look = std::chrono::steady_clock::now() + std::chrono::milliseconds(200);
    const std::string folder = runtime_folder(waiting.graph), found = graph_start(folder);
    if (found.empty()) {
      forget(), waiting.tell();
      return false;
    }
    if (found == start) return true;
    std::ifstream file(folder + "/addresses");
    std::string kind, to;
    if (!(file >> kind >> std::ws && std::getline(file, to))) {
      forget(), waiting.tell("graph '" + waiting.graph + "' with '--source socket'");
      return false;
    }
    list = std::make_unique<Channels>(folder + "/channels");
    aim(to);
    start = found;
    waiting.end();
    return true;
  }

  // Sends there from now on: another start, whose numbers begin anew.
  void aim(const std::string &to) {
    forget();
    aimed = to;
    if (to.find('/') != std::string::npos) {
      sockaddr_un file{};
      file.sun_family = AF_UNIX;
      if (to.size() >= sizeof file.sun_path) fail(to + ": too long for a socket's path");
      std::memcpy(file.sun_path, to.c_str(), to.size());
      std::memcpy(&address, &file, length = sizeof file);
    } else {
      const size_t colon = to.rfind(':');
      std::string host = to.substr(0, colon);
      if (host.size() > 1 && host[0] == '[') host = host.substr(1, host.size() - 2);
      addrinfo wanted{}, *answer = nullptr;
      wanted.ai_socktype = SOCK_DGRAM;
      if (getaddrinfo(host.c_str(), to.substr(colon + 1).c_str(), &wanted, &answer) != 0 || answer == nullptr)
        fail(to + ": no address");
      std::memcpy(&address, answer->ai_addr, length = answer->ai_addrlen);
      freeaddrinfo(answer);
    }
    sender = socket(address.ss_family, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (sender < 0) fail(to + ": " + std::strerror(errno));
    if (address.ss_family == AF_UNIX) {
      // A name of the kernel's choice: a socket without one gets no verdicts.
      const sockaddr_un unnamed{AF_UNIX, {}};
      if (bind(sender, reinterpret_cast<const sockaddr *>(&unnamed), sizeof unnamed.sun_family) != 0)
        fail(to + ": " + std::strerror(errno));
    }
    epoch = std::chrono::steady_clock::now().time_since_epoch().count(), seq = 0;
  }
};

}  // namespace vigil
