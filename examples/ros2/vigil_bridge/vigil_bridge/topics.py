"""Subscribes to topics of types that only the robot knows."""

from rclpy.qos import qos_profile_sensor_data

from .message import class_of
from .misfit import Misfit


class Topics:
    """Subscriptions to come: each is made once its topic has a type."""

    def __init__(self, node, types):
        self._node, self._awaited, self._told = node, {}, set()
        self._types = {node.resolve_topic_name(topic): kind for topic, kind in types.items()}

    def expect(self, topic, take, check=lambda kind: None):
        """`check(kind)` is called with the class once it is known, and `take(message)` with each message."""
        self._awaited.setdefault(topic, []).append((take, check))

    def look(self):
        """Subscribes to the topics that have a type by now; called again and again."""
        there = dict(self._node.get_topic_names_and_types())
        for topic in list(self._awaited):
            name = self._node.resolve_topic_name(topic)
            types = [self._types[name]] if name in self._types else there.get(name, [])
            if len(types) > 1:
                raise Misfit(f"topic '{name}' has the types {', '.join(types)}: write the right one in 'types'")
            if types:
                self._subscribe(topic, class_of(types[0]))
            elif topic not in self._told:
                self._told.add(topic)
                self._node.get_logger().info(f"waiting for topic '{name}'")

    def _subscribe(self, topic, kind):
        for take, check in self._awaited.pop(topic):
            check(kind)
            # Best effort, as sensors often publish; it also hears those that are reliable.
            self._node.create_subscription(kind, topic, take, qos_profile_sensor_data)
        self._node.get_logger().info(f"subscribed to '{self._node.resolve_topic_name(topic)}' ({kind.__name__})")
