"""A graph with a black box whose launcher is killed: it is taken over, or stopped, and leaves nothing."""

import contextlib
import json
import os
import pathlib
import signal
import subprocess
import tempfile
import unittest

from harness import BINARIES, WATCHDOG_S, Graph, events, vigil, wait_for
from schemas import problems


def lives(pid):
    """False once a process has ended, whether or not somebody has waited for it."""
    try:
        stat = pathlib.Path(f"/proc/{pid}/stat").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return False
    return stat.rpartition(") ")[2][0] not in "ZX"


def members(folder):
    """Processes of the graph of a folder: its services and its black box hold its lock open, and its launcher."""
    found = set()
    for opened in pathlib.Path("/proc").glob("[0-9]*/fd/*"):
        with contextlib.suppress(OSError):
            if os.readlink(opened) == str(folder / "lock"):
                found.add(int(opened.parts[2]))
    return found


def shared_memory(graph):
    return list(pathlib.Path("/dev/shm").glob(f"vigil_{graph.name}_*"))


class Orphans(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.recordings = pathlib.Path(folder.name)

    def orphan(self, graph):
        """Kills the launcher of a graph once its black box keeps what it does; its folder, and what is listed then."""
        # Whatever fails, nothing goes on after the test.
        self.addCleanup(lambda: graph.listed() and vigil("stop", "--graph", graph.name))
        folder = graph.wait_until_armed()
        wait_for(lambda: graph.listed()["blackbox"] and (folder / "memory/ring").exists(), "its black box")
        before = graph.listed()
        self.assertEqual(before["launcher"], graph.launcher.pid)
        pids = {of["pid"] for of in before["services"]} | {before["blackbox"], before["launcher"]}
        self.assertEqual(members(folder), pids, "there is nobody else")
        self.assertGreater(len(shared_memory(graph)), 0)
        self.assertTrue(any(path.is_socket() for path in folder.rglob("*")))
        graph.launcher.kill()
        graph.launcher.wait()
        after = graph.listed()
        self.assertEqual(after, {**before, "launcher": None, "up_s": after["up_s"]}, "all else drives on")
        self.assertTrue(lives(after["blackbox"]))
        said = vigil("list")
        self.assertEqual(said.returncode, 1, "somebody has to look after it")
        line = next(line for line in said.stdout.splitlines() if line.split()[0] == graph.name)
        self.assertIn(f"NO LAUNCHER: `vigil run --adopt --graph {graph.name}` or `vigil stop", line)
        return folder, after

    def assert_nothing_is_left(self, graph, folder, *pids):
        self.assertIsNone(graph.listed())
        self.assertEqual([pid for pid in pids if lives(pid)], [])
        self.assertEqual(members(folder), set())
        self.assertEqual(shared_memory(graph), [])
        left = list(folder.rglob("*"))
        self.assertEqual([path for path in left if path.is_socket()], [])
        kept = [path.name for path in left if path.name in ("memory", "ring", "processes", "request", "recordings")]
        self.assertEqual(kept, [])
        self.assertEqual([path.name for path in left if path.name.startswith("unwritten")], [])
        self.assertEqual(list(self.recordings.rglob("*.part")), [], "what was begun is finished")

    def test_a_black_box_is_taken_over_with_its_graph_and_looked_after(self):
        with Graph("--duration", "60", recordings=self.recordings) as graph:
            folder, orphan = self.orphan(graph)
            command = [BINARIES / "vigil", "run", "--adopt", "--json", "--graph", graph.name]
            launcher = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
            self.addCleanup(launcher.kill)
            wait_for(lambda: graph.listed()["launcher"], "the new launcher")
            adopted = graph.listed()
            self.assertEqual(adopted, {**orphan, "launcher": launcher.pid, "up_s": adopted["up_s"]})
            self.assertEqual(vigil("snapshot", "taken over", "--graph", graph.name).returncode, 0)
            wait_for(lambda: list(self.recordings.glob("*/*-request.mcap")), "what the same black box writes")

            # The new launcher is not its parent, and sees its end all the same.
            os.kill(orphan["blackbox"], signal.SIGKILL)
            known = [None, orphan["blackbox"]]
            wait_for(lambda: graph.listed()["blackbox"] not in known, "another black box")
            again = graph.listed()
            self.assertTrue(lives(again["blackbox"]))
            self.assertEqual(again["services"], orphan["services"])
            wait_for(lambda: list(self.recordings.glob("*/*-crash.mcap")), "what the killed one kept")
            self.assertEqual([service for service, _ in graph.told("restarted")], ["blackbox"])

            said = vigil("stop", "--graph", graph.name)
            self.assertEqual(said.returncode, 0, said.stderr)
            printed, told = launcher.communicate(timeout=WATCHDOG_S)
            graph.launcher.communicate(timeout=WATCHDOG_S)
        summary = json.loads(printed)
        self.assertEqual(problems("run", summary), [])
        self.assertEqual(summary["ended"], "stopped", told)
        self.assertEqual(len(events(summary, "adopted")), 1)
        pids = [of["pid"] for of in orphan["services"]]
        pids += [graph.launcher.pid, launcher.pid, orphan["blackbox"], again["blackbox"]]
        self.assert_nothing_is_left(graph, folder, *pids)

    def test_a_graph_without_launcher_is_stopped_with_its_black_box(self):
        with Graph("--duration", "60", recordings=self.recordings, after_s=20.0) as graph:
            folder, orphan = self.orphan(graph)
            # What is being written when the end comes is finished with what there is.
            self.assertEqual(vigil("snapshot", "at last", "--graph", graph.name).returncode, 0)
            wait_for(lambda: list(self.recordings.rglob("*.part")), "a recording that is begun")
            said = vigil("stop", "--graph", graph.name)
            self.assertEqual(said.returncode, 0, said.stderr)
            graph.launcher.communicate(timeout=WATCHDOG_S)
        self.assert_nothing_is_left(graph, folder, orphan["blackbox"], *(of["pid"] for of in orphan["services"]))
        self.assertEqual(len(list(self.recordings.glob("*/*-request.mcap"))), 1)
        # The name is free again.
        with Graph("--duration", "1", name=graph.name) as again:
            again.finish()


if __name__ == "__main__":
    unittest.main()
