// Finds the places of a frame's command and channels by their names: a robot's channel list.
#pragma once
#include "vigil_types.h"

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <map>
#include <string>

namespace vigil {

[[noreturn]] inline void fail(const std::string &why) {
  std::fprintf(stderr, "%s\n", why.c_str());
  std::exit(1);
}

// The list of a file: `channels` in a running graph's folder, or what `vigil channels --robot F` printed.
class Channels {
 public:
  explicit Channels(const std::string &path) {
    std::ifstream file(path);
    for (std::string kind, number, name, rest; file >> kind >> number >> name && std::getline(file, rest);)
      if (kind == "robot")
        robot_hash = std::strtoull(number.c_str(), nullptr, 16);
      else if (kind == "command" || kind == "channel")
        (kind == "command" ? axes : channels)[name] = std::atoi(number.c_str());
    if (robot_hash == 0) fail(path + ": no channel list: it has no line 'robot HASH NAME'");
  }

  // Writes a channel and marks it as measured; ends the program, with the names that there are, if it is none.
  void set(vigil_sensor_frame &frame, const std::string &name, double value) const {
    const int place = find(channels, name);
    frame.channel[place] = value, frame.channel_valid |= uint64_t(1) << place;
    frame.robot_hash = robot_hash;
  }

  // The same for an axis of the command.
  void command(vigil_sensor_frame &frame, const std::string &name, double value) const {
    const int place = find(axes, name);
    frame.command[place] = value, frame.command_valid |= uint32_t(1) << place;
    frame.robot_hash = robot_hash;
  }

  uint64_t robot_hash = 0;

 private:
  using Places = std::map<std::string, int>;
  Places axes, channels;

  static int find(const Places &places, const std::string &name) {
    const auto found = places.find(name);
    if (found != places.end()) return found->second;
    std::string all;
    for (const auto &place : places) all += " " + place.first;
    fail("'" + name + "' is none of" + all);
  }
};

}  // namespace vigil
