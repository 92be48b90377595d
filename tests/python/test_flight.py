"""What the black box has written is read by others' readers: what was measured, believed and done before an alarm."""

import csv
import datetime
import json
import os
import pathlib
import select
import signal
import subprocess
import tempfile
import time
import tomllib
import unittest

from harness import BINARIES, WATCHDOG_S, Graph, events, vigil, wait_for
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore
from schemas import problems

WHEELS = ["LF", "LM", "LR", "RF", "RM", "RR"]


def decoded_by_rosbags(path, topics):
    """How many messages of these topics a second, independent reader decodes."""
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        wanted = [one for one in reader.connections if one.topic in topics]
        messages = reader.messages(connections=wanted)
        return sum(reader.deserialize(data, of.msgtype) is not None for of, _, data in messages)


class Flight:
    """A recording, decoded by the readers of ROS 2's format; two that know nothing of each other agree."""

    def __init__(self, path):
        self.messages, self.raw, self.topics = {}, {}, set()
        with open(path, "rb") as file:
            reader = make_reader(file, decoder_factories=[DecoderFactory()])
            self.header = reader.get_header()
            for schema, channel, message in reader.iter_messages():
                self.topics.add(channel.topic)
                if channel.message_encoding != "cdr":
                    self.raw.setdefault(channel.topic, []).append(message)
        with open(path, "rb") as file:
            reader = make_reader(file, decoder_factories=[DecoderFactory()])
            cdr = {topic for topic in self.topics if topic not in self.raw}
            for decoded in reader.iter_decoded_messages(topics=cdr):
                entry = decoded.message.log_time, decoded.decoded_message
                self.messages.setdefault(decoded.channel.topic, []).append(entry)
            self.attachments = {attachment.name: attachment.data for attachment in reader.iter_attachments()}
            self.about = {entry.name: entry.metadata for entry in reader.iter_metadata()}
        count = decoded_by_rosbags(path, cdr)
        assert count == sum(map(len, self.messages.values())), (path, count)

    def last(self, topic):
        return self.messages[topic][-1][1]

    def named(self, topic):
        """The last values of a topic that has names for them."""
        message = self.last(topic)
        return dict(zip(message.name, message.position))


def replayed(path):
    """What `vigil replay` says of a recording, and of each of its services."""
    said = vigil("replay", path, "--verify", "--json")
    document = json.loads(said.stdout)
    assert not (wrong := problems("replay", document)), wrong
    return document, {of["service"]: of for of in document["services"]}


def retold(path, *options, **settings):
    """The lines that `vigil replay` prints of a recording, but for the one that says how fast it was."""
    command = [BINARIES / "vigil", "replay", path, *options]
    said = subprocess.run(command, capture_output=True, text=True, timeout=WATCHDOG_S, **settings)
    assert said.returncode == 0, said
    return timeless(said.stdout)


def timeless(text):
    return [line for line in text.splitlines() if " times their pace" not in line]


class BlackBox(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def recordings(self, reason):
        return sorted(self.folder.glob(f"*/*-{reason}.mcap"))

    def blackbox(self, graph):
        """Its process id."""
        listed = graph.listed()
        return listed and listed["blackbox"]

    def states(self, graph):
        """Of its faults, by name."""
        listed = json.loads(vigil("faults", "--json", "--graph", graph.name).stdout)["faults"]
        return {fault["name"]: fault["state"] for fault in listed}

    def assert_told_alike(self, path):
        """Slowed down, or a line at a time, the same is told."""
        told = retold(path)
        for wanted in ["detector: alarm", "identifier: RM_STUCK", "supervisor: compensate"]:
            self.assertTrue(any(wanted in line for line in told), (wanted, told))
        self.assertEqual(retold(path, "--speed", "100"), told)
        self.assertEqual(retold(path, "--step", input="\n" * len(told)), told)
        command = [BINARIES / "vigil", "replay", path, "--step"]
        with subprocess.Popen(command, bufsize=0, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as stepped:
            lines = [stepped.stdout.readline()]
            self.assertEqual(select.select([stepped.stdout], [], [], 0.5)[0], [], "it waits for Enter")
            stepped.stdin.write(b"\n")
            lines.append(stepped.stdout.readline())
            self.assertEqual(select.select([stepped.stdout], [], [], 0.5)[0], [], "and again")
            rest, _ = stepped.communicate(b"\n" * len(told), timeout=WATCHDOG_S)
        self.assertEqual(timeless((b"".join(lines) + rest).decode()), told)

    def assert_mended(self, cut):
        """Others' readers want the end of a file, which a cut one lacks."""
        whole = self.folder / "whole.mcap"
        said = vigil("mend", cut, "--out", whole)
        self.assertEqual(said.returncode, 0, said)
        self.assertGreater(len(Flight(whole).raw["/vigil/raw/sensor"]), 50)
        document, _ = replayed(whole)
        self.assertEqual((document["is_cut"], document["differences"]), (True, []), document)
        self.assertEqual(vigil("mend", cut, "--out", whole).returncode, 2, "it is not replaced")
        frames = self.folder / "frames.csv"
        said = vigil("frames", whole, "--out", frames, "--json")
        self.assertEqual(problems("frames", json.loads(said.stdout)), [])
        with open(frames) as file:
            rows = list(csv.DictReader(file))
        self.assertEqual(len(rows), json.loads(said.stdout)["frames"])
        self.assertGreater(max(float(row["cmd_speed"]) for row in rows), 0.05)

    def test_an_alarm_is_written_with_what_was_before_and_after_it(self):
        with Graph("--inject", "stuck:RM@4", "--duration", "60", recordings=self.folder) as graph:
            path, *_ = wait_for(lambda: self.recordings("alarm"), "a recording")
            summary = graph.stop()
        flight = Flight(path)
        self.assertEqual(flight.header.profile, "ros2")
        alarm = next(event for event in summary["events"] if event["event"] == "alarm")
        self.assertGreater(alarm["t_s"], 4)
        self.assertEqual(events(summary, "diagnosis")[0], "RM_STUCK")

        # In a table the alarm is where the wheel has come to stand.
        table = self.folder / "alarm.csv"
        said = vigil("frames", path, "--out", table, "--json")
        (found,) = json.loads(said.stdout)["alarms"]
        with open(table) as file:
            rows = [(float(row["t"]), float(row["enc_RM"])) for row in csv.DictReader(file)]
        stands_s = next(t for t, rate in rows if t > 2 and abs(rate) < 0.5)
        self.assertTrue(0 <= found["t_s"] - stands_s < 1, (found, stands_s))

        # Each frame, with the wheel that stands still since the fault.
        wheels = flight.last("/joint_states")
        speed = dict(zip(wheels.name, wheels.velocity))
        moving = [speed[name] for name in speed if name[:2] in WHEELS and abs(speed[name]) > 0.1]
        self.assertGreaterEqual(len(moving), 5, speed)
        times = [log_time for log_time, _ in flight.messages["/joint_states"]]
        self.assertEqual(times, sorted(times))
        self.assertGreater(times[-1] - times[0], 3.5e9)
        frames = flight.raw["/vigil/raw/sensor"]
        self.assertEqual(len(frames), len(times))
        numbers = [frame.sequence for frame in frames]
        self.assertEqual(numbers, list(range(numbers[0], numbers[0] + len(numbers))), "no frame is missing")

        # Beliefs have names.
        belief = flight.named("/vigil/belief")
        self.assertGreater(belief["RM_STUCK"], 0.9, belief)
        before = flight.messages["/vigil/belief"][0][1]
        self.assertGreater(dict(zip(before.name, before.position))["ND"], 0.9)
        levels = {status.name: status.level for status in flight.last("/diagnostics").status}
        self.assertTrue(any("RM_STUCK" in name for name in levels), levels)
        actions = [message.data for _, message in flight.messages["/vigil/action"]]
        self.assertIn("compensate:RM", actions[-1])
        told = [message.msg for _, message in flight.messages["/vigil/events"]]
        self.assertTrue(any("alarm" in text for text in told), told)
        self.assertEqual(flight.about["vigil"]["reason"], "alarm")
        self.assertIn(b"rate_hz", flight.attachments["document.toml"])

    def test_what_is_asked_for_is_written(self):
        with Graph("--duration", "60", recordings=self.folder) as graph:
            graph.wait_until_up()
            wait_for(lambda: self.blackbox(graph), "a black box")
            said = wait_for(lambda: vigil("snapshot", "odd noise", "--graph", graph.name).stdout, "an answer")
            self.assertEqual(said.strip(), str(self.folder / graph.name))
            path, *_ = wait_for(lambda: self.recordings("request"), "a recording")
            listed = json.loads(vigil("recordings", "--json", "--graph", graph.name).stdout)
            self.assertEqual(problems("recordings", listed), [])
            self.assertEqual(listed["folder"], str(self.folder / graph.name))
            self.assertIn(path.name, [one["name"] for one in listed["recordings"]])
            graph.stop()
            # They are found after the end, too.
            config = pathlib.Path(graph.folder.name) / "config/rover.toml"
            said = vigil("recordings", "--json", "--graph", graph.name, "--config", config)
            self.assertIn(path.name, [one["name"] for one in json.loads(said.stdout)["recordings"]])
            missing = vigil("recordings", "--graph", f"{graph.name}-other", "--config", config)
            self.assertEqual((missing.returncode, "no recordings" in missing.stderr), (1, True), missing)
        self.assertEqual(Flight(path).about["vigil"]["what"], "odd noise")

    def test_reasons_that_overlap_make_one_recording_named_after_the_gravest(self):
        with Graph("--inject", "stuck:RM@4", "--duration", "60", recordings=self.folder, after_s=8.0) as graph:
            graph.wait_until_armed()
            said = vigil("snapshot", "odd noise", "--graph", graph.name)
            self.assertEqual(said.returncode, 0, said)
            asked_ns = time.time_ns()
            self.assertEqual(graph.told("alarm"), [], "it was asked for before")
            # Whatever else is written, the request is in none of its own.
            path, *_ = wait_for(lambda: self.recordings("alarm") + self.recordings("request"), "a recording")
            graph.stop()
        written = [one for one in self.folder.rglob("*.mcap*") if "-miss" not in one.name]
        self.assertEqual((written, path), (self.recordings("alarm"), written[0]))
        flight = Flight(path)
        about = flight.about["vigil"]
        self.assertEqual((about["reason"], about["what"]), ("alarm", "alarm, says detector"))
        causes = [cause.partition(" ") for cause in about["causes"].splitlines()]
        self.assertEqual(causes[0][2], "alarm, says detector", causes)
        self.assertEqual(about["when"], causes[0][0])
        requests = [when for when, _, text in causes if text == "odd noise"]
        self.assertEqual(len(requests), 1, causes)
        self.assertLess(requests[0], about["when"], "what came first does not name it")
        # It holds what was before the request, and what followed the alarm.
        times = [log_time for log_time, _ in flight.messages["/joint_states"]]
        self.assertLess(times[0], asked_ns - 1e9)
        alarm_ns = datetime.datetime.fromisoformat(about["when"]).timestamp() * 1e9
        self.assertGreater(times[-1] - alarm_ns, 6e9)

    def test_a_black_box_that_is_killed_leaves_what_it_had_and_another_goes_on(self):
        with Graph("--duration", "60", recordings=self.folder) as graph:
            graph.wait_until_up()
            first = wait_for(lambda: self.blackbox(graph), "a black box")
            ring = graph.wait_until_armed() / "memory/ring"
            wait_for(ring.exists, "its memory")
            killed_ns = time.time_ns()
            os.kill(first, signal.SIGKILL)
            second = wait_for(lambda: self.blackbox(graph) not in (None, first) and self.blackbox(graph), "another")
            self.assertNotEqual(second, first)
            path, *_ = wait_for(lambda: self.recordings("crash"), "a recording")
            restarted = [service for service, _ in graph.told("restarted")]
            self.assertEqual(restarted, ["blackbox"])
            summary = graph.stop()
        self.assertEqual([event["service"] for event in summary["events"] if event["event"] == "restarted"], restarted)
        times = [log_time for log_time, _ in Flight(path).messages["/joint_states"]]
        # To the last second before it was killed.
        self.assertGreater(times[-1], killed_ns - 1e9)
        self.assertGreater(times[-1] - times[0], 1e9)
        self.assertEqual([service["restarts"] for service in summary["services"].values()], [0, 0, 0, 0])

    def test_what_it_kept_is_written_when_a_graph_without_launcher_is_stopped(self):
        with Graph("--duration", "60", recordings=self.folder) as graph:
            ring = graph.wait_until_armed() / "memory/ring"
            found = wait_for(lambda: self.blackbox(graph), "a black box")
            wait_for(ring.exists, "its memory")
            second = [BINARIES / "vigil-blackbox", "--graph", graph.name]
            second = subprocess.run(second, capture_output=True, text=True, timeout=WATCHDOG_S, check=False)
            self.assertEqual((second.returncode, "lives" in second.stderr), (1, True), second)
            graph.launcher.kill()
            graph.launcher.wait()
            os.kill(found, signal.SIGKILL)
            said = vigil("stop", "--graph", graph.name)
            self.assertEqual(said.returncode, 0, said)
            graph.launcher.communicate()
            self.assertFalse(ring.exists())
        flight = Flight(*self.recordings("crash"))
        self.assertGreater(len(flight.raw["/vigil/raw/sensor"]), 50)
        told = [message.msg for _, message in flight.messages["/vigil/events"]]
        self.assertTrue(any("armed" in text for text in told), told)

    def test_a_service_that_is_killed_is_a_crash(self):
        with Graph("--duration", "60", recordings=self.folder, before_s=30.0) as graph:
            graph.wait_until_armed()
            os.kill(graph.pid("detector"), signal.SIGKILL)
            path, *_ = wait_for(lambda: self.recordings("crash"), "a recording")
            graph.stop()
        flight = Flight(path)
        self.assertIn("detector", flight.about["vigil"]["what"])
        writers = {message.data[8:16] for message in flight.raw["/vigil/raw/detection"]}
        self.assertEqual(len(writers), 2, "both processes of the detector")
        # The second begins anew, so that all of its answers can be computed again. The others may
        # have begun before there was a black box, and wait for their first state.
        document, services = replayed(path)
        self.assertEqual(document["differences"], [])
        self.assertGreater(services["detector"]["compared"], 0, document)

    def test_a_recording_of_any_length_is_computed_again_to_the_last_bit(self):
        path = self.folder / "drive.mcap"
        with Graph("--inject", "stuck:RM@14", "--duration", "60", recordings=self.folder, before_s=30.0) as graph:
            graph.wait_until_armed()
            command = [BINARIES / "vigil", "record", path, "--graph", graph.name, "--duration", "25"]
            with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as recorder:
                # The order is computed again, too, whether or not its block was recorded.
                state = lambda: self.states(graph).get("RM_STUCK")
                wait_for(lambda: state() == "active", "the fault")
                said = vigil("ack", "RM_STUCK", "--graph", graph.name)
                self.assertEqual(said.returncode, 0, said)
                wait_for(lambda: state() == "acknowledged", "the order")
                said, _ = recorder.communicate(timeout=WATCHDOG_S)
            self.assertEqual(recorder.returncode, 0, said)
            # So much of it, but for a pause of the machine.
            self.assertRegex(said, rf"^{path}: 2[45]\.")
            again = vigil("record", path, "--graph", graph.name)
            self.assertEqual((again.returncode, "--force" in again.stderr), (2, True), again)
            kept, *_ = wait_for(lambda: self.recordings("alarm"), "a recording")
            graph.stop()
        flight = Flight(path)
        self.assertEqual(flight.about["vigil"]["reason"], "record")
        told = [message.msg for _, message in flight.messages["/vigil/events"]]
        self.assertTrue(any("alarm" in text for text in told), told)
        self.assertTrue(any("RM_STUCK" in text and "acknowledged" in text for text in told), told)
        # The graph's own black box was not disturbed.
        for recording in [path, kept]:
            document, services = replayed(recording)
            self.assertTrue(document["identical"], document)
            for service in ["detector", "identifier", "supervisor"]:
                self.assertGreater(services[service]["compared"], 0, document)
        self.assert_told_alike(kept)

    def test_a_full_disk_is_said_and_the_black_box_writes_again_when_there_is_room(self):
        mount = ["mount", "-t", "tmpfs", "-o", "size=3m", "vigil-test", self.folder]
        if subprocess.run(mount, stderr=subprocess.DEVNULL).returncode != 0:
            self.skipTest("mounting a small disk needs root")
        self.addCleanup(subprocess.run, ["umount", self.folder], check=True)
        with Graph("--duration", "60", recordings=self.folder) as graph:
            graph.wait_until_armed()
            first = wait_for(lambda: self.blackbox(graph), "a black box")
            time.sleep(3)
            vigil("snapshot", "too much", "--graph", graph.name)
            # A miss of this machine may have come first, and taken all the room.
            cut, *_ = wait_for(lambda: self.recordings("*cut"), "what there was room for")
            subprocess.run(["mount", "-o", "remount,size=64m", self.folder], check=True)
            vigil("snapshot", "enough", "--graph", graph.name)
            path, *_ = wait_for(lambda: self.recordings("request"), "a recording")
            self.assertEqual(self.blackbox(graph), first, "it was not restarted")
            graph.launcher.terminate()
            _, told = graph.launcher.communicate(timeout=WATCHDOG_S)
        self.assertGreaterEqual(told.count("no recording"), 1, told)
        self.assertEqual(told.count("No space left on device"), told.count("no recording"), told)
        self.assertEqual(Flight(path).about["vigil"]["what"], "enough")
        self.assertTrue(replayed(cut)[0]["is_cut"])

    def test_what_a_killed_black_box_kept_waits_for_room_even_beyond_the_end_of_its_graph(self):
        mount = ["mount", "-t", "tmpfs", "-o", "size=64k", "vigil-test", self.folder]
        if subprocess.run(mount, stderr=subprocess.DEVNULL).returncode != 0:
            self.skipTest("mounting a small disk needs root")
        self.addCleanup(subprocess.run, ["umount", self.folder], check=True)
        killed = []
        with Graph("--duration", "60", recordings=self.folder) as graph:
            folder = graph.wait_until_armed()
            unwritten = lambda: sorted(path.name for path in folder.glob("unwritten-*"))
            for count in [1, 2]:
                found = wait_for(lambda: self.blackbox(graph) not in killed and self.blackbox(graph), "a black box")
                wait_for(lambda: (folder / "memory/ring").exists() and len(unwritten()) == count - 1, "its memory")
                time.sleep(1)
                os.kill(found, signal.SIGKILL)
                killed += [None, found]
            wait_for(lambda: len(unwritten()) == 2, "what both kept")
            wait_for(lambda: (folder / "memory/ring").exists(), "the third")
            graph.stop()
        self.assertEqual(unwritten(), ["unwritten-1", "unwritten-2"])
        self.assertFalse((folder / "memory").exists())
        subprocess.run(["mount", "-o", "remount,size=64m", self.folder], check=True)
        # A graph of this name that has nothing to do with it.
        with Graph("--rate", "50", "--duration", "1", name=graph.name) as again:
            again.wait_until_up()
            self.assertEqual(unwritten(), [])
        first, second = map(Flight, self.recordings("crash"))
        for flight in [first, second]:
            document = tomllib.loads(flight.attachments["document.toml"].decode())
            self.assertEqual(document["file"]["graph"]["rate_hz"], 100)
            self.assertGreater(len(flight.raw["/vigil/raw/sensor"]), 50)
        # Each has the events of its own time, and none of the other graph's.
        told = [[message.msg for _, message in flight.messages["/vigil/events"]] for flight in [first, second]]
        self.assertEqual([sum("armed" in text for text in of) for of in told], [1, 0], told)

    def test_a_recording_ends_with_a_signal_or_its_graph(self):
        path = self.folder / "drive.mcap"
        with Graph("--duration", "60") as graph:
            graph.wait_until_armed()

            def record(*options):
                command = [BINARIES / "vigil", "record", path, "--graph", graph.name, *options]
                recorder = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
                wait_for(lambda: part.exists() and part.stat().st_size > 2e6, "its content")
                return recorder

            part = pathlib.Path(f"{path}.part")
            killed = record()
            killed.kill()
            killed.communicate()
            self.assertTrue(replayed(part)[0]["is_cut"])
            self.assert_mended(part)
            part.unlink()
            recorder = record()
            recorder.send_signal(signal.SIGINT)
            said, _ = recorder.communicate(timeout=WATCHDOG_S)
            self.assertEqual((recorder.returncode, part.exists()), (0, False), said)
            recorder = record("--force", "--json")
            graph.stop()
            printed, said = recorder.communicate(timeout=WATCHDOG_S)
            document = json.loads(printed)
            self.assertEqual(problems("record-mcap", document), [])
            self.assertEqual((document["recording"], document["bytes"]), (str(path), path.stat().st_size))
            self.assertEqual((recorder.returncode, part.exists()), (0, False), said)
            self.assertIn("the graph has ended", said)
        self.assertGreater(len(Flight(path).raw["/vigil/raw/sensor"]), 50)


if __name__ == "__main__":
    unittest.main()
