"""Keeps the newest value of each channel, and makes frames of them."""

import math

from .misfit import Misfit
from .wire import vigil_types as vigil

# A stamp that goes back by more is another clock, as when a recording starts again: another run.
SET_BACK_NS = 1_000_000_000


def check_names(channels, sources):
    """Misfit if the robot has no such channel."""
    there = [*channels.axes, *channels.channels]
    if unknown := [name for name in sources if name not in there]:
        raise Misfit(f"the graph's robot has no channel {', '.join(unknown)}; it has {', '.join(there)}")


class Frames:
    """Newest values by channel. A value counts from when it came: drivers leave stamps out, or set them wrongly."""

    def __init__(self, sources, max_age_s, command_timeout_s=0.0):
        self.sources, self.max_age_s, self.command_timeout_s = sources, max_age_s, command_timeout_s
        self._newest, self._run_id, self._captured_ns = {}, 1, 0

    def take(self, topic, message, now_s):
        """Takes the values of a message; those that it does not have stay: joints may come from several nodes."""
        for name, source in self.sources.items():
            if source.topic == topic and (value := source.value(message)) is not None:
                self._newest[name] = value, now_s

    def frame(self, channels, capture_ns, now_s):
        """A frame of what is known at `now_s`; what is too old, or not a number, is not measured."""
        if capture_ns < self._captured_ns - SET_BACK_NS:
            self._run_id += 1
        self._captured_ns = capture_ns
        frame = vigil.SensorFrame(run_id=self._run_id, robot_hash=channels.robot_hash)
        frame.header.t_capture_ns = capture_ns
        for name in self.sources:
            value = self._value(name, name in channels.axes, now_s)
            if not math.isnan(value):
                (channels.command if name in channels.axes else channels.set)(frame, name, value)
        return frame

    def missing(self, channels, now_s):
        """Names of the channels that a frame would now hold no value of."""
        return [name for name in self.sources if math.isnan(self._value(name, name in channels.axes, now_s))]

    def _value(self, name, is_command, now_s):
        value, since_s = self._newest.get(name, (math.nan, -math.inf))
        stops_itself = is_command and self.command_timeout_s > 0
        if now_s - since_s <= (self.command_timeout_s if stops_itself else self.max_age_s):
            return value
        return 0.0 if stops_itself else math.nan
