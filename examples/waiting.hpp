// Finds running graphs, and says what a publisher waits for.
#pragma once
#include "channels.hpp"

#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <dirent.h>
#include <fcntl.h>
#include <set>
#include <string>
#include <sys/file.h>
#include <sys/stat.h>
#include <thread>
#include <unistd.h>
#include <vector>

namespace vigil {

inline void wait_a_little() { std::this_thread::sleep_for(std::chrono::milliseconds(100)); }

// Where the folders of graphs lie.
inline std::vector<std::string> graph_folders() {
  auto variable = [](const char *name) {
    const char *value = std::getenv(name);
    return std::string(value ? value : "");
  };
  const std::string user = variable("XDG_RUNTIME_DIR"), temporary = variable("TMPDIR");
  std::vector<std::string> folders = {"/run/vigil"};
  if (!user.empty()) folders.push_back(user + "/vigil");
  folders.push_back((temporary.empty() ? "/tmp" : temporary) + "/vigil-" + std::to_string(getuid()));
  return folders;
}

// True if a launcher or a service holds the lock of a graph: what was killed left its files.
inline bool is_running(const std::string &folder) {
  struct stat found;
  if (stat((folder + "/processes").c_str(), &found) != 0) return false;
  const int lock = open((folder + "/lock").c_str(), O_RDONLY | O_CLOEXEC);
  if (lock < 0) return false;
  const bool is_held = flock(lock, LOCK_SH | LOCK_NB) != 0 && errno == EWOULDBLOCK;
  close(lock);
  return is_held;
}

// Folder of the running graph of this name; empty while there is none: the graph cleans up what joins before it.
inline std::string runtime_folder(const std::string &graph) {
  std::string closed;
  for (const std::string &folder : graph_folders()) {
    struct stat found;
    const int result = stat((folder + "/" + graph + "/processes").c_str(), &found);
    if (result == 0 && is_running(folder + "/" + graph)) return folder + "/" + graph;
    if (result != 0 && errno == EACCES) closed = folder;
  }
  if (!closed.empty()) fail("no graph '" + graph + "' of yours is running, and " + closed + " is another user's");
  return "";
}

// What is different after each start of the graph; empty while it does not run.
inline std::string graph_start(const std::string &folder) {
  struct stat list;
  if (folder.empty() || stat((folder + "/processes").c_str(), &list) != 0) return "";
  return std::to_string(list.st_ino) + " " + std::to_string(list.st_mtim.tv_sec) + " " +
         std::to_string(list.st_mtim.tv_nsec);
}

// A publisher's wait for the graph of this name.
class Waiting {
 public:
  explicit Waiting(std::string graph) : graph(std::move(graph)) {}

  // Says what it waits for, unless it has said so just now.
  void tell(const std::string &what) {
    const auto now = std::chrono::steady_clock::now();
    if (is_told && now - told < std::chrono::seconds(5)) return;
    is_told = true, told = now;
    std::set<std::string> names;
    for (const std::string &folder : graph_folders())
      if (DIR *entries = opendir(folder.c_str())) {
        while (const dirent *entry = readdir(entries))
          if (is_running(folder + "/" + entry->d_name)) names.insert(entry->d_name);
        closedir(entries);
      }
    std::string running;
    for (const std::string &name : names) running += (running.empty() ? "" : ", ") + name;
    std::fprintf(stderr, "waiting for %s; running: %s\n", what.c_str(), running.empty() ? "none" : running.c_str());
  }
  void tell() { tell("graph '" + graph + "'"); }

  // The graph is there.
  void end() {
    if (is_told) std::fprintf(stderr, "joined graph '%s'\n", graph.c_str());
    is_told = false;
  }

  const std::string graph;

 private:
  bool is_told = false;
  std::chrono::steady_clock::time_point told;
};

}  // namespace vigil
