"""Joins a running graph through shared memory; waits until there is one.

pip install iceoryx2==0.10.0
"""

import time

import iceoryx2

import vigil_types as vigil

COMING = ["DoesNotExist", "HangsInCreation", "IsMarkedForDestruction", "ServiceInCorruptedState"]


def join(graph, open_ports):
    """A node in the graph of this name, and what `open_ports(topic)` returns; keep both.

    `topic("sensor")` is the builder of a topic of the graph. Waits for the graph; SystemExit with both sides' types
    if they differ.
    """
    while True:
        try:
            node = iceoryx2.NodeBuilder.new().config(vigil.transport(graph)).create(iceoryx2.ServiceType.Ipc)
            name = lambda topic: iceoryx2.ServiceName.new(f"vigil/{graph}/{topic}")
            return node, open_ports(lambda topic: node.service_builder(name(topic)))
        except iceoryx2.PublisherCreateError as error:
            raise SystemExit(f"{error}: a publisher is connected, and the graph admits one")
        except (FileNotFoundError, iceoryx2.EventOpenError, iceoryx2.PublishSubscribeOpenError) as error:
            # Not there yet, or just being made.
            if not any(reason in str(error) for reason in COMING):
                raise SystemExit(f"{error}: {vigil.difference(graph)}")
            time.sleep(0.1)


def sensor(topic):
    """Publisher of frames, and the bell that wakes their readers."""
    bell = topic("sensor").event().open().notifier_builder().create()
    return topic("sensor").publish_subscribe(vigil.SensorFrame).open().publisher_builder().create(), bell
