"""The way to a graph, which may start later than the bridge."""

import threading

from .frames import check_names
from .misfit import Misfit
from .wire import SocketPublisher


class Link:
    """Sends frames to the graph of this name or address, and gets its verdicts. Nothing here waits."""

    def __init__(self, settings):
        self._sources, self._publisher, self._error, self._checked = settings.sources, None, None, None
        if settings.is_address:
            self._join(settings.graph, settings.channel_list)
        else:
            # A publisher waits for its graph; the node stops the robot meanwhile, and says so.
            threading.Thread(target=self._join, args=(settings.graph,), daemon=True).start()

    def _join(self, *words):
        try:
            self._publisher = SocketPublisher(*words)
        except (OSError, ValueError) as error:
            self._error = error

    @property
    def channels(self):
        """The robot's channel list; None before the graph is there. Misfit if it lacks a channel."""
        if self._error is not None:
            raise Misfit(str(self._error))
        if self._publisher is None:
            return None
        channels = self._publisher.channels
        # Another start of the graph may be of another robot.
        if channels is not self._checked:
            check_names(channels, self._sources)
            self._checked = channels
        return channels

    def publish(self, frame):
        return self._publisher.publish(frame)

    def verdict(self):
        """The newest verdict that has come since the last call, or None."""
        return None if self._publisher is None else self._publisher.verdict()
