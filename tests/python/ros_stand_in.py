"""Stands in for rclpy and for the packages of messages, so that a node runs without ROS.

Messages have the real definitions: whatever a node publishes is written in CDR by an independent library, which
refuses fields of a wrong name or type.
"""

import functools
import sys
import types

from ros_messages import STORE, message

PACKAGES = ["diagnostic_msgs", "geometry_msgs", "nav_msgs", "sensor_msgs", "std_msgs"]


def message_class(kind):
    """A class as a package of messages has it: made with defaults, or with fields by name."""

    class Made:
        def __new__(cls, **fields):
            made = message(kind)
            made.__class__ = cls
            for name, value in fields.items():
                setattr(made, name, value)
            return made

    real = STORE.types[kind]
    name = kind.rpartition("/")[2]
    # The library's class is a dataclass, whose own __init__ wants every field.
    return type(name, (real,), {"__new__": Made.__new__, "__init__": lambda self, **fields: None})


def plain(value):
    """A message as the library writes it: its one type of bytes is a number."""
    for name, of in list(vars(value).items()):
        if isinstance(of, bytes):
            setattr(value, name, of[0])
        for one in of if isinstance(of, list) else [of]:
            if hasattr(one, "__dataclass_fields__"):
                plain(one)
    return value


class Ros:
    """What a node finds: parameters, remapped topics, topics of other nodes; and what it does."""

    # What the next node finds.
    here = None

    def __init__(self, parameters=(), topics=(), remapped=()):
        self.parameters, self.topics, self.remapped = dict(parameters), dict(topics), dict(remapped)
        self.subscriptions, self.timers, self.published, self.logged = {}, [], {}, []
        self.now_s = 1000.0

    def name(self, topic):
        """Its full name."""
        full = topic if topic.startswith("/") else f"/{topic}"
        return self.remapped.get(topic) or full.replace("/~", "/vigil_bridge")

    def send(self, topic, sent):
        """Another node publishes."""
        for take in self.subscriptions.get(topic, []):
            take(sent)

    def pass_time(self, seconds, step_s=0.01):
        for _ in range(round(seconds / step_s)):
            self.now_s += step_s
            for timer in self.timers:
                if self.now_s >= timer["due_s"] - 1e-9:
                    timer["due_s"] += timer["period_s"]
                    timer["callback"]()

    def of(self, topic):
        return self.published.get(topic, [])


class Publisher:
    def __init__(self, ros, topic):
        self.ros, self.topic = ros, topic

    def publish(self, made):
        self.ros.published.setdefault(self.topic, []).append(made)
        STORE.serialize_cdr(plain(made), made.__msgtype__)
        self.ros.send(self.topic, made)


class Parameter:
    def __init__(self, value):
        self.value = value


class Logger:
    def __init__(self, ros):
        self.ros = ros

    def info(self, text):
        self.ros.logged.append(text)

    fatal = info


class Time:
    def __init__(self, now_s):
        self.nanoseconds = round(now_s * 1e9)

    def to_msg(self):
        sec, nanosec = divmod(self.nanoseconds, 10**9)
        return message("builtin_interfaces/Time", sec=sec, nanosec=nanosec)


class Clock:
    def __init__(self, clock_type=None, ros=None):
        self.clock_type, self.ros = clock_type, ros

    def now(self):
        return Time(self.ros.now_s)


class Node:
    def __init__(self, name, automatically_declare_parameters_from_overrides=False):
        assert automatically_declare_parameters_from_overrides
        self._name, self._ros, self._declared = name, Ros.here, dict(Ros.here.parameters)

    def get_name(self):
        return self._name

    def get_logger(self):
        return Logger(self._ros)

    def get_clock(self):
        return Clock(ros=self._ros)

    def get_parameters_by_prefix(self, prefix):
        assert prefix == ""
        return {name: Parameter(value) for name, value in self._declared.items()}

    def has_parameter(self, name):
        return name in self._declared

    def declare_parameter(self, name, value):
        assert name not in self._declared
        # What rclpy takes for a list of bytes, and refuses to set later.
        assert value != []
        self._declared[name] = value

    def resolve_topic_name(self, topic):
        return self._ros.name(topic)

    def get_topic_names_and_types(self):
        return list(self._ros.topics.items())

    def create_publisher(self, kind, topic, depth):
        assert depth == 10
        return Publisher(self._ros, self._ros.name(topic))

    def create_subscription(self, kind, topic, callback, qos):
        assert qos == "sensor data"
        self._ros.subscriptions.setdefault(self._ros.name(topic), []).append(callback)

    def create_timer(self, period_s, callback, clock=None):
        due_s = self._ros.now_s + period_s
        self._ros.timers.append({"period_s": period_s, "callback": callback, "due_s": due_s, "clock": clock})


class Context:
    """Whether rclpy runs; what spins is called once."""

    def __init__(self):
        self.spun, self.is_up = None, False

    def init(self, args=None):
        self.is_up = True

    def spin(self, node):
        if self.spun is not None:
            self.spun(node)

    def try_shutdown(self):
        self.is_up = False


@functools.cache
def install():
    """Puts all of it where a node imports it from, once a process; the Context."""
    rclpy, context = types.ModuleType("rclpy"), Context()
    rclpy.init, rclpy.spin, rclpy.try_shutdown = context.init, context.spin, context.try_shutdown
    rclpy.create_node = Node
    parts = {
        "clock": {"Clock": Clock, "ClockType": types.SimpleNamespace(STEADY_TIME="steady")},
        "executors": {"ExternalShutdownException": type("ExternalShutdownException", (Exception,), {})},
        "logging": {"get_logger": lambda name: Logger(Ros.here)},
        "qos": {"qos_profile_sensor_data": "sensor data"},
    }
    modules = {"rclpy": rclpy}
    for name, content in parts.items():
        modules[f"rclpy.{name}"] = types.ModuleType(f"rclpy.{name}")
        vars(modules[f"rclpy.{name}"]).update(content)
        setattr(rclpy, name, modules[f"rclpy.{name}"])
    for package in PACKAGES:
        kinds = [kind for kind in STORE.types if kind.startswith(f"{package}/msg/")]
        modules[package], inner = types.ModuleType(package), types.ModuleType(f"{package}.msg")
        vars(inner).update({kind.rpartition("/")[2]: message_class(kind) for kind in kinds})
        modules[f"{package}.msg"] = modules[package].msg = inner
    sys.modules.update(modules)
    return context
