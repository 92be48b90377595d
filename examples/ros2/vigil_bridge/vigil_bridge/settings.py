"""The parameters of the bridge, checked."""

import math

from .misfit import Misfit
from .sources import Source

DEFAULTS = {
    # Name of a graph on this machine, or host:port of its UDP socket, or the path of its Unix socket.
    "graph": "rover",
    # File that `vigil channels` wrote; needed where `graph` is an address.
    "channel_list": "",
    # A message on this topic makes a frame; "" for a timer.
    "trigger": "odom",
    # Of that timer.
    "rate_hz": 20.0,
    # What is older is sent as not measured.
    "max_age_s": 0.5,
    # The base stops by itself this long after its last command, which is then sent as 0; 0 if it does not stop.
    "command_timeout_s": 0.0,
    # Whether commands pass from `cmd_vel_in` to `cmd_vel_out`, as the verdict has them.
    "obey": True,
    # The sharpest curve that the base can drive, to which commands are held; 0 for any.
    "curvature_max_1_m": 0.0,
    # "TOPIC package/msg/Type", for a topic whose type is not to be looked up.
    "types": [""],
}
PREFIX = "channels."
# What ROS itself gives a node.
OF_ROS = ("use_sim_time", "start_type_description_service", "qos_overrides.")
POSITIVE = ("rate_hz", "max_age_s")


class Settings:
    """`graph`, `trigger` and the others of DEFAULTS; `sources` by the names of channels, `types` by topic."""

    def __init__(self, parameters):
        """`parameters`: values by name, `channels.x` for those in the map `channels`."""
        known = {name: value for name, value in parameters.items() if not name.startswith(OF_ROS)}
        channels = {name[len(PREFIX) :]: known.pop(name) for name in list(known) if name.startswith(PREFIX)}
        if unknown := sorted(set(known) - set(DEFAULTS)):
            raise Misfit(f"there is no parameter {', '.join(unknown)}; there are {', '.join(DEFAULTS)}, channels")
        for name, default in DEFAULTS.items():
            setattr(self, name, _checked(name, known.get(name, default), default))
        if not channels:
            raise Misfit("no parameter below 'channels': give the node a file of parameters, such as config/rover.yaml")
        self.sources = {name: Source(name, _checked(PREFIX + name, text, "")) for name, text in channels.items()}
        self.types = dict(map(_type, filter(None, self.types)))
        self.is_address = ":" in self.graph or "/" in self.graph
        if self.is_address and not self.channel_list:
            raise Misfit(f"graph '{self.graph}' is an address: 'channel_list' is to be the file of `vigil channels`")

    def topics(self):
        """All topics that frames are made of."""
        topics = [source.topic for source in self.sources.values()]
        return list(dict.fromkeys(topics + [self.trigger] * bool(self.trigger)))


def _checked(name, value, default):
    """The value, if it is of its default's type. An int is taken for a float, as in a file it is easily one."""
    if isinstance(default, float) and isinstance(value, int) and not isinstance(value, bool):
        value = float(value)
    if isinstance(default, list) and isinstance(value, (list, tuple)):
        return list(value)
    if not isinstance(value, type(default)):
        raise Misfit(f"parameter '{name}' is {value!r}: it is to be like {default!r}")
    if isinstance(default, float) and not (math.isfinite(value) and value >= 0 and (value or name not in POSITIVE)):
        raise Misfit(f"parameter '{name}' is {value}: it is to be {'above 0' if name in POSITIVE else '0 or more'}")
    return value


def _type(text):
    topic, _, name = str(text).strip().partition(" ")
    if "/" not in name:
        raise Misfit(f"'types' has '{text}': write a topic and a type, such as 'cmd_vel geometry_msgs/msg/Twist'")
    return topic, name.strip()
