"""Publishes recorded frames through shared memory at a stated rate for a stated time, round and round.

pace.py GRAPH HZ SECONDS AFTER; prints one JSON document: frames sent, when the first and the last of them were due,
and how late they were, in us. A frame that is lost shows in the sequence numbers when the next one arrives: AFTER more
frames, at the same rate, follow the last one, and are neither counted nor measured.
"""

import json
import pathlib
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "examples"))

import recording
from joining import join, sensor

graph, hz, seconds, after = sys.argv[1], float(sys.argv[2]), float(sys.argv[3]), int(sys.argv[4])
frames = list(recording.frames(ROOT / "tests/data/rover/learn_frames.csv.gz", 0))
node, (publisher, bell) = join(graph, sensor)
# All readers are there before the first frame: none is lost unseen.
time.sleep(2)
epoch = due = time.monotonic_ns()
period, count, late_us = round(1e9 / hz), round(hz * seconds), []
for seq in range(count + after):
    frame = frames[seq % len(frames)]
    due += period
    time.sleep(max(0, due - time.monotonic_ns()) / 1e9)
    # Each round of the recording is a run of its own.
    frame.run_id = 1 + seq // len(frames)
    frame.header.epoch, frame.header.seq = epoch, seq
    frame.header.t_schedule_ns = frame.header.t_capture_ns = due
    frame.header.t_publish_ns = time.monotonic_ns()
    sample = publisher.loan_uninit().write_payload(frame)
    # Not after the bell: whom it wakes may take this core before it returns.
    late_us.append((time.monotonic_ns() - due) / 1e3)
    sample.send()
    bell.notify()
late_us = sorted(late_us[:count])
at = lambda q: late_us[min(count - 1, int(q * count))]
sent = {"sent": count, "due_ns": [epoch + period, epoch + count * period]}
print(json.dumps(sent | {"late_us": {"p50": at(0.5), "p99": at(0.99), "max": late_us[-1]}}))
