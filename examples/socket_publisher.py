"""Sends a recorded drive to a graph with `--source socket`: nothing but Python's own library.

python3 socket_publisher.py FRAMES.csv.gz RUN [HZ] [ADDRESS] [CHANNELS]
ADDRESS: host:port of the graph's UDP socket, or the path of its Unix socket.
CHANNELS: file with what `vigil channels --robot F` printed; rover.channels if it is not given.
"""

import socket
import sys
import time

import recording
import vigil_types as vigil

path, run = sys.argv[1], int(sys.argv[2])
hz = float(sys.argv[3]) if len(sys.argv) > 3 else 20.0
address = sys.argv[4] if len(sys.argv) > 4 else "127.0.0.1:7401"
channels = vigil.Channels.read(sys.argv[5]) if len(sys.argv) > 5 else None

if "/" in address:
    sender, to = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM), address
else:
    host, port = address.rsplit(":", 1)
    sender, to = socket.socket(socket.AF_INET, socket.SOCK_DGRAM), (host, int(port))
frames = list(recording.frames(path, run, channels))
print(f"sending {len(frames)} frames at {hz} Hz to {address}; scripts/up shows 'alarm' and 'diagnosis'")

epoch = due = time.monotonic_ns()
for seq, frame in enumerate(frames):
    due += round(1e9 / hz)
    time.sleep(max(0, due - time.monotonic_ns()) / 1e9)
    frame.header.epoch, frame.header.seq = epoch, seq
    # Left at 0, as from another machine: t_schedule_ns. The capture times are the recording's.
    sender.sendto(vigil.datagram(frame), to)
print("done")
