"""Publishes a recorded drive into a running graph, through shared memory.

pip install iceoryx2==0.10.0
python3 publisher.py FRAMES.csv.gz RUN [GRAPH] [HZ]
"""

import sys
import time

import recording
from joining import Publisher

path, run, *words = sys.argv[1:]
graph = words[0] if words else "rover"
hz = float(words[1]) if len(words) > 1 else 20.0
publisher = Publisher(graph)
frames = list(recording.frames(path, int(run), publisher.channels))
print(f"publishing {len(frames)} frames at {hz} Hz; scripts/up shows 'alarm' and 'diagnosis'")
due = time.monotonic_ns()
for frame in frames:
    due += round(1e9 / hz)
    time.sleep(max(0, due - time.monotonic_ns()) / 1e9)
    publisher.publish(frame, due)
