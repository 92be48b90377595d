"""Publishes into a graph through shared memory; waits for it aloud, and joins it again after a restart.

pip install iceoryx2==0.10.0
"""

import importlib.metadata
import time

import iceoryx2

import vigil_types as vigil
from waiting import LOOK_NS, Waiting, graph_start

COMING = ["DoesNotExist", "HangsInCreation", "IsMarkedForDestruction", "ServiceInCorruptedState"]


def join(graph, open_ports):
    """A node in the graph of this name, and what `open_ports(topic)` returns; keep both.

    `topic("sensor")` is the builder of a topic of the graph. Waits for the graph, and says so; SystemExit with both
    sides' types if they differ.
    """
    waiting = Waiting(graph)
    while (joined := _try_to_join(graph, open_ports, waiting)) is None:
        time.sleep(0.1)
    return joined


def _try_to_join(graph, open_ports, waiting):
    """The same, or None while there is nothing to join."""
    try:
        folder = vigil.runtime_folder(graph)
        _demand_version(graph, folder)
        node = iceoryx2.NodeBuilder.new().config(vigil.transport(graph)).create(iceoryx2.ServiceType.Ipc)
        name = lambda topic: iceoryx2.ServiceName.new(f"vigil/{graph}/{topic}")
        joined = node, open_ports(lambda topic: node.service_builder(name(topic)))
    except iceoryx2.PublisherCreateError as error:
        raise SystemExit(f"{error}: a publisher is connected, and the graph admits one")
    except FileNotFoundError:
        waiting.tell()
    except (iceoryx2.EventOpenError, iceoryx2.PublishSubscribeOpenError, iceoryx2.NodeCreationFailure) as error:
        # Just being made, or just being taken away.
        if isinstance(error, iceoryx2.NodeCreationFailure) or any(reason in str(error) for reason in COMING):
            waiting.tell(f"the topics of graph '{graph}' ({error})")
        else:
            raise SystemExit(f"{error}: {vigil.difference(graph)}")
    else:
        waiting.end()
        return joined


def _demand_version(graph, folder):
    """Another version of iceoryx2 finds none of the graph's topics, however long it waits."""
    with open(f"{folder}/types") as file:
        there = file.readline().split()[3]
    if importlib.metadata.version("iceoryx2") != there:
        raise SystemExit(vigil.difference(graph))


def sensor(topic):
    """Publisher of frames, and the bell that wakes their readers."""
    bell = topic("sensor").event().open().notifier_builder().create()
    return topic("sensor").publish_subscribe(vigil.SensorFrame).open().publisher_builder().create(), bell


class Publisher:
    """Publishes the frames of a robot into the graph of this name.

    `Publisher(graph)` waits for the graph; `channels` is then its channel list, which sets values by their names.
    `publish(frame)` never waits. If the graph has ended it says so, and joins the next one of that name by itself.
    SystemExit if the graph has other types, or a publisher.
    """

    def __init__(self, graph="rover", open_ports=sensor):
        """`open_ports` may open more than the publisher and its bell; `further` is the rest."""
        # Its warnings are about files that the graph has just cleaned up.
        iceoryx2.set_log_level(iceoryx2.LogLevel.Error)
        self.graph, self.waiting, self._open_ports, self._node = graph, Waiting(graph), open_ports, None
        while not self._try_to_join():
            time.sleep(0.1)

    def publish(self, frame, due_ns=None):
        """Fills in the header and sends the frame; False if there is no graph to take it.

        `due_ns`: when the frame was due, CLOCK_MONOTONIC; now if it is left out. A capture time of 0 becomes the same.
        """
        now_ns = time.monotonic_ns()
        if now_ns >= self._look_ns and not self._is_joined(now_ns):
            return False
        if self._node is None:
            return False
        header = frame.header
        header.schema, header.epoch, header.seq = vigil.SensorFrame.SCHEMA, self._epoch, self._seq
        header.t_schedule_ns = due_ns if due_ns is not None else now_ns
        header.t_capture_ns = header.t_capture_ns or header.t_schedule_ns
        header.t_publish_ns = time.monotonic_ns()
        try:
            self._publisher.loan_uninit().write_payload(frame).send()
            self._bell.notify()
        except (iceoryx2.LoanError, iceoryx2.SendError, iceoryx2.NotifierNotifyError):
            # Between two looks the graph has taken its files away.
            if self._start == graph_start(self.graph):
                raise
            return False
        self._seq += 1
        return True

    def _is_joined(self, now_ns):
        """Looks for the graph; joins the one that there is."""
        self._look_ns = now_ns + LOOK_NS
        if self._node is not None and self._start == graph_start(self.graph):
            return True
        self._publisher = self._bell = self.further = self._node = None
        return self._try_to_join()

    def _try_to_join(self):
        start = graph_start(self.graph)
        joined = _try_to_join(self.graph, self._open_ports, self.waiting)
        if joined is None:
            return False
        try:
            self.channels = vigil.channel_list(self.graph)
        except FileNotFoundError:
            return False
        self._node, (self._publisher, self._bell, *self.further) = joined
        # Another start is another epoch: its numbers begin anew.
        self._start, self._epoch, self._seq = start, time.monotonic_ns(), 0
        self._look_ns = self._epoch + LOOK_NS
        return True
