"""Publishes recorded frames through shared memory at a stated rate for a stated time, round and round.

pace.py GRAPH HZ SECONDS; prints one JSON document: frames sent, and how late each was, in us.
"""

import json
import pathlib
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "examples"))

import iceoryx2

import recording
import vigil_types as vigil

graph, hz, seconds = sys.argv[1], float(sys.argv[2]), float(sys.argv[3])
frames, publisher = list(recording.frames(ROOT / "tests/data/rover/learn_frames.csv.gz", 0)), None
while publisher is None:
    try:
        node = iceoryx2.NodeBuilder.new().config(vigil.transport(graph)).create(iceoryx2.ServiceType.Ipc)
        topic = node.service_builder(iceoryx2.ServiceName.new(f"vigil/{graph}/sensor"))
        bell = topic.event().open().notifier_builder().create()
        publisher = topic.publish_subscribe(vigil.SensorFrame).open().publisher_builder().create()
    except (FileNotFoundError, iceoryx2.EventOpenError, iceoryx2.PublishSubscribeOpenError) as error:
        if "DoesNotExist" not in str(error):
            raise
        time.sleep(0.1)
epoch = due = time.monotonic_ns()
late_us = []
for seq in range(round(hz * seconds)):
    frame = frames[seq % len(frames)]
    due += round(1e9 / hz)
    time.sleep(max(0, due - time.monotonic_ns()) / 1e9)
    # Each round of the recording is a run of its own.
    frame.run_id = 1 + seq // len(frames)
    frame.header.epoch, frame.header.seq = epoch, seq
    frame.header.t_schedule_ns = frame.header.t_capture_ns = due
    frame.header.t_publish_ns = time.monotonic_ns()
    publisher.loan_uninit().write_payload(frame).send()
    bell.notify()
    late_us.append((time.monotonic_ns() - due) / 1e3)
late_us.sort()
at = lambda q: late_us[min(len(late_us) - 1, int(q * len(late_us)))]
print(json.dumps({"sent": len(late_us), "late_us": {"p50": at(0.5), "p99": at(0.99), "max": late_us[-1]}}))
