"""Publishes recorded frames through shared memory at a stated rate for a stated time, round and round.

pace.py GRAPH HZ SECONDS; prints one JSON document: frames sent, and how late each was, in us.
"""

import json
import pathlib
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "examples"))

import recording
from joining import join, sensor

graph, hz, seconds = sys.argv[1], float(sys.argv[2]), float(sys.argv[3])
frames = list(recording.frames(ROOT / "tests/data/rover/learn_frames.csv.gz", 0))
node, (publisher, bell) = join(graph, sensor)
# All readers are there before the first frame: none is lost unseen.
time.sleep(2)
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
