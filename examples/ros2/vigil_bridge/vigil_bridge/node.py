"""The program: messages in, frames to the graph; verdicts back, to `/diagnostics` and to the robot's command."""

import sys
import time

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType
from rclpy.executors import ExternalShutdownException
from std_msgs.msg import String

from . import report
from .commands import IN, Commands
from .frames import Frames
from .link import Link
from .misfit import Misfit
from .newest import Newest
from .settings import DEFAULTS, Settings
from .topics import Topics

# Verdicts are looked for this often: a robot stops at most this much late.
LOOK_S = 0.02
# Topics without a publisher are looked for this often.
TOPICS_S = 0.5
# Diagnostics are published at each change, and this often without one.
DIAGNOSTICS_S = 1.0


class Bridge:
    """One robot's way to one graph, and back."""

    def __init__(self, node, clock=time.monotonic):
        self.node = node
        given = {name: parameter.value for name, parameter in node.get_parameters_by_prefix("").items()}
        self.settings = settings = Settings(given)
        for name, default in DEFAULTS.items():
            if not node.has_parameter(name):
                node.declare_parameter(name, default)
        self._clock, self._told, self._told_s = clock, None, None
        self._frames = Frames(settings.sources, settings.max_age_s, settings.command_timeout_s)
        self._newest = Newest()
        self._diagnostics = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._verdicts = node.create_publisher(String, "~/verdict", 10)
        self._topics = Topics(node, settings.types)
        self._unite_topics()
        for topic in settings.topics():
            self._topics.expect(topic, self._taker(topic), self._checker(topic))
        self._commands = None
        if settings.obey:
            self._commands = Commands(node, self._newest, settings.curvature_max_1_m, clock)
            self._topics.expect(IN, self._commands.take, self._commands.open)
        self._topics.look()
        self.link = Link(settings)
        # By the steady clock: the robot is also to stop while simulated time stands.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(LOOK_S, self._look, clock=steady)
        node.create_timer(TOPICS_S, self._topics.look, clock=steady)
        if not settings.trigger:
            node.create_timer(1.0 / settings.rate_hz, lambda: self._send(None))

    def _unite_topics(self):
        """One name for each topic: `odom` and `/odom` may be the same one, which is to be heard once."""
        first, settings = {}, self.settings
        same = lambda topic: first.setdefault(self.node.resolve_topic_name(topic), topic)
        for source in settings.sources.values():
            source.topic = same(source.topic)
        settings.trigger = settings.trigger and same(settings.trigger)

    def _checker(self, topic):
        """Looks whether a type has what the channels want of it, before its first message."""
        sources = [source for source in self.settings.sources.values() if source.topic == topic]

        def check(kind):
            for source in sources:
                try:
                    source.find(kind())
                except Misfit as misfit:
                    raise Misfit(f"topic '{topic}' ({kind.__name__}): {misfit}")

        return check

    def _taker(self, topic):
        def take(message):
            self._frames.take(topic, message, self._clock())
            if topic == self.settings.trigger:
                self._send(getattr(message, "header", None))

        return take

    def _send(self, header):
        """Sends a frame, captured at the stamp of its trigger, or now."""
        if (channels := self.link.channels) is None:
            return
        stamp_ns = header.stamp.sec * 10**9 + header.stamp.nanosec if header is not None else 0
        capture_ns = stamp_ns or self.node.get_clock().now().nanoseconds
        frame = self._frames.frame(channels, capture_ns, self._clock())
        if self._commands is not None:
            self._commands.tell(frame)
        self.link.publish(frame)

    def _look(self):
        """Takes verdicts, stops the robot if it has none, and tells what is so."""
        is_new = self._newest.look(self.link, self._clock())
        if self._commands is not None:
            self._commands.look()
        if is_new:
            self._verdicts.publish(String(data=report.as_json(self._newest.verdict)))
        self._tell()

    def _tell(self):
        now_s, channels = self._clock(), self.link.channels
        missing = self._frames.missing(channels, now_s) if channels is not None else ()
        level, message, values = report.status(self._newest, now_s, self.settings.graph, missing)
        if (level, message) == self._told and now_s - self._told_s < DIAGNOSTICS_S:
            return
        self._told, self._told_s = (level, message), now_s
        status = DiagnosticStatus(level=bytes([level]), name=f"vigil/{self.settings.graph}/{self.node.get_name()}")
        status.message, status.hardware_id = message, self.settings.graph
        status.values = [KeyValue(key=key, value=value) for key, value in values]
        array = DiagnosticArray(status=[status])
        array.header.stamp = self.node.get_clock().now().to_msg()
        self._diagnostics.publish(array)


def main(arguments=None):
    """Runs the bridge until it is interrupted; 1 if parameters, topics or messages do not fit."""
    rclpy.init(args=arguments)
    try:
        node = rclpy.create_node("vigil_bridge", automatically_declare_parameters_from_overrides=True)
        bridge = Bridge(node)
        rclpy.spin(bridge.node)
    except Misfit as misfit:
        rclpy.logging.get_logger("vigil_bridge").fatal(str(misfit))
        return 1
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
