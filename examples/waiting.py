"""Says what a publisher waits for, and tells one start of a graph from the next."""

import os
import sys
import time

import vigil_types as vigil

# A publisher looks this often whether its graph is still the one that it knows.
LOOK_NS = 200_000_000
# A wait is told at once, and then this often.
REPEAT_S = 5


class Waiting:
    """A publisher's wait for the graph of this name."""

    def __init__(self, graph):
        self.graph, self.told_s = graph, None

    def tell(self, what=None):
        """Says what it waits for, unless it has said so just now."""
        now_s = time.monotonic()
        if self.told_s is not None and now_s - self.told_s < REPEAT_S:
            return
        self.told_s = now_s
        running = ", ".join(vigil.running_graphs()) or "none"
        print(f"waiting for {what or f'graph {self.graph!r}'}; running: {running}", file=sys.stderr, flush=True)

    def end(self):
        """The graph is there."""
        if self.told_s is not None:
            print(f"joined graph '{self.graph}'", file=sys.stderr, flush=True)
        self.told_s = None


def graph_start(graph):
    """What is different after each start of the graph; None while it does not run."""
    try:
        file = os.stat(f"{vigil.runtime_folder(graph)}/processes")
        return file.st_ino, file.st_mtime_ns
    except FileNotFoundError:
        return None
