"""What `vigil ros2` publishes is read by an implementation of DDS that is not ours, on this machine alone."""

import os
import pathlib
import signal
import subprocess
import sys
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "python"))

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.sub import DataReader, Subscriber
from cyclonedds.topic import Topic
from cyclonedds.util import duration
from harness import BINARIES, ROOT, WATCHDOG_S, Graph, vigil
from ros2_types import DiagnosticArray, JointState, Log, ParticipantEntitiesInfo, Text

OK, WARN, ERROR, STALE = range(4)
# A domain of its own, so that tests at the same time do not hear each other.
DOMAIN = 1 + os.getpid() % 99
LOCAL = """<CycloneDDS><Domain><General><Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces>
<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>
<Peers><Peer address="127.0.0.1"/></Peers></Discovery></Domain></CycloneDDS>"""
RELIABLE = Policy.Reliability.Reliable(duration(seconds=1))
KEPT = Qos(RELIABLE, Policy.Durability.TransientLocal, Policy.History.KeepLast(1))


class Ear:
    """Hears the topics of a network."""

    def __init__(self):
        self.participant = DomainParticipant(DOMAIN)
        self.subscriber = Subscriber(self.participant)
        quality = Qos(RELIABLE, Policy.Durability.Volatile, Policy.History.KeepAll)
        diagnostics = {"diagnostics": DiagnosticArray, "vigil/faults": DiagnosticArray, "vigil/health": DiagnosticArray}
        curves = {"vigil/belief": JointState, "vigil/detection": JointState, "vigil/decision": JointState}
        others = {"vigil/action": Text, "vigil/events": Log, "joint_states": JointState}
        kinds = {**diagnostics, **curves, **others}
        self.readers = {name: self.reader(f"rt/{name}", kind, quality) for name, kind in kinds.items()}
        self.readers["nodes"] = self.reader("ros_discovery_info", ParticipantEntitiesInfo, KEPT)
        self.heard = {name: [] for name in self.readers}
        # Of each status of /diagnostics, what it said, the last of it last.
        self.said = {}

    def reader(self, topic, kind, quality):
        return DataReader(self.subscriber, Topic(self.participant, topic, kind, qos=quality), qos=quality)

    def listen(self):
        for name, reader in self.readers.items():
            for sample in reader.take(N=1000):
                # Where a writer is gone, only that is told.
                if sample.sample_info.valid_data:
                    self.heard[name].append(sample)
                    if name == "diagnostics":
                        for status in sample.status:
                            self.said.setdefault(status.name, []).append(status)

    def wait(self, look, what):
        """Until `look` finds something; what it was."""
        until = time.monotonic() + WATCHDOG_S
        while time.monotonic() < until:
            self.listen()
            found = look()
            if found:
                return found
            time.sleep(0.05)
        said = {name: [(one.level, one.message) for one in all_of][-3:] for name, all_of in self.said.items()}
        counts = {name: len(heard) for name, heard in self.heard.items()}
        raise TimeoutError(f"{what}; heard {counts}, said {said}")

    def last(self, name):
        return self.said.get(name, [None])[-1]

    def at(self, name, level):
        """Its last status, if that is of the level."""
        status = self.last(name)
        return status if status is not None and status.level == level else None


def values(status):
    return {one.key: one.value for one in status.values}


class Ros2(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        # One for all tests: a test that failed keeps its own, and a second cannot be made beside it.
        cls.domain = Domain(DOMAIN, LOCAL)

    def setUp(self):
        self.ear = Ear()

    def publish(self, graph, *options):
        """Publishes a graph that runs, or is to run."""
        here = "--domain", str(DOMAIN), "--address", "127.0.0.1"
        command = [BINARIES / "vigil", "ros2", "--graph", graph, *here, *options]
        # What the environment says of ROS would count, too.
        environment = {name: value for name, value in os.environ.items() if not name.startswith("ROS_")}
        process = subprocess.Popen(command, cwd=ROOT, env=environment, stderr=subprocess.PIPE, text=True)

        def end():
            if process.poll() is None:
                process.terminate()
            process.communicate(timeout=30)

        self.addCleanup(end)
        return process

    def test_a_fault_is_told_by_its_name_and_silence_is_stale(self):
        ear, name = self.ear, f"dds{os.getpid()}"
        whole, fault = f"vigil/{name}", f"vigil/{name}/RM_STUCK"
        process = self.publish(name)
        with Graph("--inject", "stuck:RM@12", "--duration", "100", name=name) as graph:
            ear.wait(lambda: ear.at(whole, OK), "the graph is ok")
            self.assertNotIn(fault, ear.said)
            status = ear.wait(lambda: ear.at(fault, ERROR), "the fault")
            told = values(status)
            self.assertEqual(status.hardware_id, name)
            self.assertEqual(told["code"], "VIGIL_ROBOT_RM_STUCK")
            self.assertIn(told["state"], ("active", "latched"))
            self.assertEqual(told["severity"], "fault")
            self.assertGreater(float(told["probability"]), 0.5)
            self.assertTrue(told["runner-up"])
            self.assertGreater(float(told["evidence, nat"]), 0)
            self.assertTrue(told["evidence channel"])
            self.assertEqual(told["count"], "1")
            self.assertLess(abs(float(told["first, s since 1970"]) - time.time()), 60)
            # Before it is told to be active, it is suspected.
            levels = [one.level for one in ear.said[fault]]
            self.assertIn(levels[0], (WARN, ERROR))
            ear.wait(lambda: ear.at(whole, ERROR), "the graph is not ok")

            listed = vigil("faults", "--json", "--graph", name).stdout
            self.assertIn("RM_STUCK", listed)
            ear.wait(lambda: ear.at(f"vigil/{name}/diagnosis", ERROR), "the diagnosis")
            diagnosis = values(ear.last(f"vigil/{name}/diagnosis"))
            self.assertEqual(diagnosis["mode"], "RM_STUCK")
            self.check_others()
            graph.stop()
            stale = ear.wait(lambda: ear.at(whole, STALE), "the end")
            self.assertIn("ended", stale.message)
            ear.wait(lambda: ear.at(fault, STALE), "the end of the fault")
        self.assertIsNone(process.poll(), "it waits for the next start")
        with Graph("--duration", "100", name=name) as graph:
            over = ear.wait(lambda: ear.at(fault, OK), "the fault is over")
            self.assertIn("over", over.message)
            ear.wait(lambda: ear.at(whole, OK), "the graph is ok again")
            process.send_signal(signal.SIGTERM)
            ear.wait(lambda: ear.at(whole, STALE), "nobody publishes any more")
            self.assertEqual(process.wait(timeout=30), 0, process.stderr.read())
            graph.stop()

    def check_others(self):
        """The other topics say what they are to say, each once its reader is found."""
        heard = self.ear.heard
        self.ear.wait(lambda: len(heard["vigil/belief"]) > 10, "beliefs")
        belief = heard["vigil/belief"][-1]
        self.assertGreater(dict(zip(belief.name, belief.position))["RM_STUCK"], 0.5)
        times = [one.header.stamp.sec + 1e-9 * one.header.stamp.nanosec for one in heard["vigil/belief"]]
        rate = (len(times) - 1) / (times[-1] - times[0])
        self.assertLess(rate, 11)
        self.ear.wait(lambda: any("RM" in one.data for one in heard["vigil/action"]), "the action")
        self.ear.wait(lambda: any("alarm" in one.msg for one in heard["vigil/events"]), "the alarm")

        def services():
            return {status.name.rsplit("/", 1)[1] for one in heard["vigil/health"] for status in one.status}

        all_services = {"sensor-sim", "detector", "identifier", "supervisor"}
        self.ear.wait(lambda: services() == all_services, "the health of all services")
        for topic in ("vigil/decision", "vigil/detection"):
            self.ear.wait(lambda topic=topic: len(heard[topic]) > 10, topic)
        self.assertFalse(heard["joint_states"], "the robot publishes these itself")

        def nodes():
            return [node.node_name for one in heard["nodes"] for node in one.node_entities_info_seq]

        self.ear.wait(lambda: f"vigil_dds{os.getpid()}" in nodes(), "the node")

    def test_with_all_the_robot_is_published_too_and_once_ends_with_the_graph(self):
        with Graph("--duration", "100") as graph:
            graph.wait_until_up()
            process = self.publish(graph.name, "--all", "--once", "--rate", "50")
            self.ear.wait(lambda: len(self.ear.heard["joint_states"]) > 20, "joints")
            joints = self.ear.heard["joint_states"][-1]
            self.assertEqual(len(joints.velocity), len(joints.name))
            graph.stop()
            self.assertEqual(process.wait(timeout=30), 0, process.stderr.read())


if __name__ == "__main__":
    unittest.main()
