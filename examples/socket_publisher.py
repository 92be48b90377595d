"""Sends a recorded drive to a graph with `--source socket`, and prints what the graph decides.

It needs nothing but Python's own library.

python3 socket_publisher.py FRAMES.csv.gz RUN [GRAPH] [HZ] [CHANNELS]
GRAPH: the graph's name; or host:port of its UDP socket, or the path of its Unix socket.
CHANNELS: with an address, the file with what `vigil channels --robot F` printed; rover.channels if it is not given.
"""

import sys
import time

import recording
from sending import ROVER, SocketPublisher

path, run, *words = sys.argv[1:]
graph = words[0] if words else "rover"
hz = float(words[1]) if len(words) > 1 else 20.0
publisher = SocketPublisher(graph, words[2] if len(words) > 2 else ROVER)
frames = list(recording.frames(path, int(run), publisher.channels))
print(f"sending {len(frames)} frames at {hz} Hz to {graph}; scripts/up shows 'alarm' and 'diagnosis'")
due, said = time.monotonic_ns(), None
for frame in frames:
    due += round(1e9 / hz)
    time.sleep(max(0, due - time.monotonic_ns()) / 1e9)
    # The due time is left out, as from another machine. The capture times are the recording's.
    publisher.publish(frame)
    # A robot would do as the newest one says: see docs/external-sensor.md.
    verdict = publisher.verdict()
    if verdict is not None and (verdict.action_name, verdict.mode_name) != said:
        said = verdict.action_name, verdict.mode_name
        print(f"{verdict.action_name.decode()}, {verdict.mode_name.decode()} p={verdict.p_mode:.3f}", flush=True)
print("done")
