"""Publishes a recorded drive into a running graph, through shared memory.

pip install iceoryx2==0.10.0
python3 publisher.py FRAMES.csv.gz RUN [HZ] [GRAPH]
"""

import sys
import time

import recording
import vigil_types as vigil
from joining import join, sensor

path, run = sys.argv[1], int(sys.argv[2])
hz = float(sys.argv[3]) if len(sys.argv) > 3 else 20.0
graph = sys.argv[4] if len(sys.argv) > 4 else "rover"
node, (publisher, bell) = join(graph, sensor)
frames = list(recording.frames(path, run, vigil.channel_list(graph)))
print(f"publishing {len(frames)} frames at {hz} Hz; scripts/up shows 'alarm' and 'diagnosis'")
epoch = due = time.monotonic_ns()
for seq, frame in enumerate(frames):
    due += round(1e9 / hz)
    time.sleep(max(0, due - time.monotonic_ns()) / 1e9)
    frame.header.epoch, frame.header.seq = epoch, seq
    frame.header.t_schedule_ns, frame.header.t_publish_ns = due, time.monotonic_ns()
    publisher.loan_uninit().write_payload(frame).send()
    bell.notify()
