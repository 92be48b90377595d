"""Recordings for viewers to read, made once by a graph with a wheel that sticks."""

import atexit
import collections
import functools
import os
import pathlib
import signal
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "python"))

from harness import BINARIES, WATCHDOG_S, Graph, vigil, wait_for

# Of an alarm, of a crash, of a drive by order, and the first, cut short and mended.
Recordings = collections.namedtuple("Recordings", "alarm crash drive mended")


@functools.cache
def recordings():
    """Their paths."""
    folder = tempfile.TemporaryDirectory()
    atexit.register(folder.cleanup)
    home = pathlib.Path(folder.name)
    drive, cut, mended = (home / f"{name}.mcap" for name in ["drive", "cut", "mended"])
    options = "--inject", "stuck:RM@8", "--duration", "60"
    # Short enough after the fault that the rover still drives, whatever is decided.
    times = {"before_s": 4.0, "after_s": 1.5}
    with Graph(*options, recordings=folder.name, **times) as graph:
        alarm, *_ = wait_for(lambda: list(home.glob("*/*-alarm.mcap")), "a recording")
        command = [BINARIES / "vigil", "record", drive, "--graph", graph.name, "--duration", "3"]
        subprocess.run(command, check=True, capture_output=True, timeout=WATCHDOG_S)
        os.kill(graph.pid("detector"), signal.SIGKILL)
        crash, *_ = wait_for(lambda: list(home.glob("*/*-crash.mcap")), "the recording of a crash")
        graph.stop()
    content = alarm.read_bytes()
    cut.write_bytes(content[: len(content) * 3 // 4])
    assert vigil("mend", cut, "--out", mended).returncode == 0
    return Recordings(alarm, crash, drive, mended)
