"""The faults of a running graph as they are followed, acknowledged, and not heard of for a while."""

import contextlib
import json
import os
import signal
import subprocess
import threading
import time
import unittest

from harness import BINARIES, WATCHDOG_S, Graph, vigil, wait_for
from schemas import problems

FAULT = "RM_STUCK"


class Follower:
    """A command that follows a graph; its lines as they come. Ended at the end of a `with`."""

    def __init__(self, *words):
        command = [BINARIES / "vigil", *words]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.lines = []
        self.reader = threading.Thread(target=lambda: self.lines.extend(self.process.stdout), daemon=True)

    def __enter__(self):
        self.reader.start()
        return self

    def finish(self):
        """Waits for its own end; its exit code, and what it said beside its lines."""
        code = self.process.wait(timeout=WATCHDOG_S)
        self.reader.join(timeout=WATCHDOG_S)
        return code, self.process.stderr.read()

    def documents(self):
        return [json.loads(line) for line in list(self.lines) if line.endswith("\n")]

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        self.reader.join(timeout=WATCHDOG_S)
        self.process.stdout.close()
        self.process.stderr.close()


def states(documents):
    """Of the fault, in the order in which they were printed, each as often as it was entered."""
    all_of = [fault["state"] for of in documents for fault in of["faults"] if fault["name"] == FAULT]
    return [state for state, before in zip(all_of, [None, *all_of]) if state != before]


@contextlib.contextmanager
def held(*pids):
    """Processes that stand still meanwhile."""
    try:
        for pid in pids:
            os.kill(pid, signal.SIGSTOP)
        yield
    finally:
        for pid in reversed(pids):
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGCONT)


class Faults(unittest.TestCase):
    def listed(self, graph):
        """What `vigil faults` says, and its exit code."""
        said = vigil("faults", "--json", "--graph", graph.name)
        if not said.stdout:
            return None, said.returncode
        document = json.loads(said.stdout)
        self.assertEqual(problems("faults", document), [])
        return document, said.returncode

    def told(self, graph):
        """How often it was told that the fault is active."""
        return [what for _, what in graph.told("fault")].count(f"{FAULT} is active")

    def wait_for_fault(self, graph):
        wait_for(lambda: self.told(graph), "the fault")

    def test_a_fault_is_followed_from_its_beginning_to_the_end_of_the_graph(self):
        with Graph("--inject", "stuck:RM@4", "--duration", "60") as graph:
            graph.wait_until_armed()
            words = ["faults", "--follow", "--graph", graph.name]
            with Follower(*words, "--json") as documents, Follower(*words) as text:
                wait_for(lambda: documents.lines and text.lines, "the first list")
                self.assertEqual(states(documents.documents()), [], "it is not there yet")
                wait_for(lambda: "active" in states(documents.documents()), "the fault")
                count = len(documents.documents())
                said = vigil("ack", FAULT, "--graph", graph.name)
                self.assertEqual((said.returncode, f"acknowledged {FAULT}" in said.stderr), (0, True), said)
                wait_for(lambda: "acknowledged" in states(documents.documents()), "the order")
                self.assertGreater(len(documents.documents()), count)
                graph.stop()
                ends = [documents.finish(), text.finish()]
        for code, said in ends:
            self.assertEqual((code, "the graph has ended" in said), (0, True), said)
        printed = documents.documents()
        self.assertEqual(len(printed), len(documents.lines), "a document is one line")
        self.assertEqual(problems("faults", *printed), [])
        self.assertEqual({document["graph"] for document in printed}, {graph.name})
        order = [state for state in states(printed) if state != "pending"]
        self.assertEqual(order, ["active", "acknowledged"])
        of_fault = [line.split() for line in text.lines if FAULT in line.split()]
        self.assertIn("active", [line[2] for line in of_fault], text.lines)
        self.assertEqual(of_fault[-1][1:3], [FAULT, "acknowledged"], text.lines)

    def test_what_was_known_is_stale_while_the_supervisor_is_held_and_goes_on_afterwards(self):
        with Graph("--inject", "stuck:RM@3", "--duration", "60") as graph:
            graph.wait_until_up()
            self.wait_for_fault(graph)
            supervisor = graph.pid("supervisor")
            document, code = self.listed(graph)
            number = next(fault["number"] for fault in document["faults"] if fault["name"] == FAULT)
            self.assertEqual((document["overall"] == "stale", code), (False, 1), document)
            words = ["faults", "--follow", "--json", "--graph", graph.name]
            with Follower(*words) as follower:
                wait_for(follower.documents, "the first list")
                # Held, too, the launcher does not replace the supervisor before it has been looked at.
                with held(graph.launcher.pid, supervisor):
                    wait_for(lambda: self.listed(graph)[0]["overall"] == "stale", "that it is stale")
                    said = vigil("faults", "--graph", graph.name)
                    self.assertEqual(said.returncode, 1, said)
                    lines = said.stdout.splitlines()
                    self.assertEqual(lines[0], "overall: stale")
                    self.assertEqual([line.split()[1] for line in lines if FAULT in line.split()], [FAULT], lines)
                    stale = lambda: follower.documents()[-1]["overall"] == "stale"
                    wait_for(stale, "that it is followed")
                    os.kill(graph.launcher.pid, signal.SIGCONT)
                    wait_for(lambda: graph.pid("supervisor") != supervisor, "another supervisor")
                # A block of the new one, and not what the old one has left.
                wait_for(lambda: not stale(), "the new one")
                last = wait_for(lambda: self.fresh(graph), "what it says")
            again = [fault for fault in last["faults"] if fault["name"] == FAULT]
            self.assertEqual([fault["number"] for fault in again], [number], "it is the same")
            self.assertIn(again[0]["state"], ["active", "latched"])
            time.sleep(1)
            self.assertEqual(self.told(graph), 1)
            summary = graph.stop()
        told = [event["what"] for event in summary["events"]].count(f"{FAULT} is active")
        self.assertEqual(told, 1, summary["events"])

    def fresh(self, graph):
        """What is said of the faults, unless nothing is known."""
        document, _ = self.listed(graph)
        return document if document and document["overall"] != "stale" else None


if __name__ == "__main__":
    unittest.main()
