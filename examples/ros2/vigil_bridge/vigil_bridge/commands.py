"""Passes the planner's command on as the newest verdict has it."""

from .gate import passed, stopped, twist_of
from .misfit import Misfit

IN, OUT = "cmd_vel_in", "cmd_vel_out"
# While the robot is to stand, it is told so this often.
REPEAT_S = 0.1


class Commands:
    """The way from `cmd_vel_in` to `cmd_vel_out`. Before the planner's first command nothing is published."""

    def __init__(self, node, newest, curvature_max_1_m, clock):
        self._node, self._newest, self._curvature_max_1_m, self._clock = node, newest, curvature_max_1_m, clock
        self._publisher, self._last, self._told_stop_s = None, None, None
        self.action_seq = 0
        if node.resolve_topic_name(IN) == node.resolve_topic_name(OUT):
            raise Misfit(f"{IN} and {OUT} are one topic: the bridge would hear itself")

    def open(self, kind):
        """Publishes commands of the type that the planner has."""
        if not hasattr(twist_of(kind()), "linear"):
            raise Misfit(f"{IN} is of type {kind.__name__}: it is to be Twist or TwistStamped")
        self._publisher = self._node.create_publisher(kind, OUT, 10)

    @property
    def is_used(self):
        """True once a planner sends its commands through here."""
        return self._last is not None

    def take(self, command):
        """Passes a command on."""
        now_s = self._clock()
        self._last = command
        verdict = self._newest.driving(now_s)
        self._obey(now_s)
        self._told_stop_s = now_s if verdict is None else None
        self._publisher.publish(passed(command, verdict, self._curvature_max_1_m))

    def look(self):
        """Stops the robot if it may not drive any more: its planner may be silent, and its base without a watchdog."""
        now_s = self._clock()
        if not self.is_used or self._newest.driving(now_s) is not None:
            return
        self._obey(now_s)
        if self._told_stop_s is None or now_s - self._told_stop_s >= REPEAT_S:
            self._told_stop_s = now_s
            stop = stopped(self._last)
            if hasattr(stop, "header"):
                stop.header.stamp = self._node.get_clock().now().to_msg()
            self._publisher.publish(stop)

    def tell(self, frame):
        """Says in a frame what the robot makes of Vigil's actions. When an action is done the bridge does not know."""
        if self.is_used:
            frame.action_seq = self.action_seq
            frame.safe_stop = int(self._newest.rejection(self._clock()) is not None)

    def _obey(self, now_s):
        if self._newest.rejection(now_s) is None:
            self.action_seq = self._newest.verdict.decision_seq
