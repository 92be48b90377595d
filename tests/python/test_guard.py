"""What a publisher sends that is wrong is refused by its cause, live, and exactly counted."""

import socket
import time
import unittest

from harness import FRAMES, STUCK_RUN, Graph

import recording
import vigil_types as vigil

RATE_HZ = 100
PERIOD_NS = 10**9 // RATE_HZ
# Good frames after each bad one: as many as a source in quarantine needs.
GOOD = 17


class Source:
    """Good frames on an absolute schedule, and what `send` makes of them."""

    def __init__(self, send):
        self.send, self.frames = send, list(recording.frames(FRAMES, STUCK_RUN))
        self.due = self.epoch = time.monotonic_ns()
        self.seq = 0

    def next(self):
        """The frame that is due now."""
        self.due += PERIOD_NS
        time.sleep(max(0, self.due - time.monotonic_ns()) / 1e9)
        frame = vigil.SensorFrame.from_buffer_copy(self.frames[self.seq % len(self.frames)])
        frame.header.epoch, frame.header.seq = self.epoch, self.seq
        frame.header.t_schedule_ns = frame.header.t_capture_ns = self.due
        # Each round of the recording is a run of its own.
        frame.run_id = 1 + self.seq // len(self.frames)
        self.seq += 1
        return frame

    def good(self, count=GOOD):
        for _ in range(count):
            self.send(self.next())


def change(frame, **fields):
    """The frame with other values; `header_` before those of its header, a pair for one of a list."""
    for name, value in fields.items():
        owner, name = (frame.header, name[7:]) if name.startswith("header_") else (frame, name)
        if isinstance(value, tuple):
            getattr(owner, name)[value[0]] = value[1]
        else:
            setattr(owner, name, value)
    return frame


# Places of some of the rover's channels.
ENC_RF, ENC_RM, STEER_LF = 6, 7, 9
# Cause, and how a good frame that is due now is made bad.
BAD = [
    ("no-epoch", lambda f: change(f, header_epoch=0)),
    ("other-writer", lambda f: change(f, header_epoch=f.header.epoch + 1)),
    ("wrong-sequence", lambda f: change(f, header_seq=f.header.seq - 5)),
    ("repeated", lambda f: change(f, header_seq=f.header.seq - 1)),
    ("ahead", lambda f: change(f, header_t_schedule_ns=f.header.t_schedule_ns + 10**12)),
    ("behind", lambda f: change(f, header_t_schedule_ns=f.header.t_schedule_ns - 11 * 10**9)),
    ("early", lambda f: change(f, header_t_schedule_ns=f.header.t_schedule_ns - PERIOD_NS + 1000)),
    ("not-finite", lambda f: change(f, channel=(ENC_RF, float("nan")))),
    ("not-finite", lambda f: change(f, channel=(1, float("inf")))),
    ("out-of-range", lambda f: change(f, channel=(STEER_LF, 25.0))),
    ("out-of-range", lambda f: change(f, action_outcome=77)),
    ("out-of-range", lambda f: change(f, channel_valid=f.channel_valid | 1 << 40)),
    ("robot", lambda f: change(f, robot_hash=f.robot_hash ^ 1)),
    ("jump", lambda f: change(f, channel=(0, f.channel[0] + 5000.0))),
]


class Guard(unittest.TestCase):
    def test_every_cause_is_counted_at_the_socket(self):
        expected = {}
        with Graph("--source", "socket", "--rate", str(RATE_HZ)) as graph:
            address = graph.wait_for_socket()
            to = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
            self.addCleanup(to.close)
            source = Source(lambda frame: to.sendto(vigil.datagram(frame), str(address)))
            source.good(100)
            for cause, spoil in BAD:
                source.send(spoil(source.next()))
                source.good()
                # The way back is a jump as well.
                expected[cause] = expected.get(cause, 0) + (2 if cause == "jump" else 1)
            bad = vigil.SensorFrame()
            for cause, spoil in [("malformed", lambda b: b[:-1]), ("corrupt", lambda b: b[:-1] + b"\x7f")]:
                to.sendto(spoil(vigil.datagram(bad)), str(address))
                expected[cause] = 1
            wrong = bytearray(vigil.datagram(source.next()))
            wrong[16] ^= 0xFF
            wrong[12:16] = vigil.crc32c(bytes(wrong[:12] + wrong[16:])).to_bytes(4, "little")
            to.sendto(bytes(wrong), str(address))
            expected["schema"] = 1
            source.good(100)
            summary = graph.stop()
        ours = summary["services"]["sensor-sim"]
        self.assertEqual(ours["rejected"], expected)
        # What was refused never got further: the stages behind saw good frames alone.
        self.assertEqual(summary["services"]["detector"]["rejected"], {})
        self.assertEqual(summary["services"]["identifier"]["rejected"], {})
        told = {event["what"].split(": ")[1] for event in summary["events"] if event["event"] == "rejected"}
        self.assertEqual(told, set(expected))

    def test_a_source_of_garbage_is_quarantined_and_comes_back(self):
        with Graph("--source", "socket", "--rate", str(RATE_HZ)) as graph:
            address = graph.wait_for_socket()
            to = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
            self.addCleanup(to.close)
            source = Source(lambda frame: to.sendto(vigil.datagram(frame), str(address)))
            source.good(100)
            for _ in range(8):
                source.send(change(source.next(), channel=(ENC_RF, float("nan"))))
            source.good(100)
            summary = graph.stop()
        # The sixteenth good one in a row is taken again.
        self.assertEqual(summary["services"]["sensor-sim"]["rejected"], {"not-finite": 8, "quarantined": 15})
        told = [event["what"] for event in summary["events"] if event["event"] == "degraded"]
        self.assertTrue(any("source in quarantine" in what for what in told), told)

    def test_both_readers_refuse_what_comes_through_shared_memory(self):
        from joining import join, sensor

        with Graph("--source", "external", "--rate", str(RATE_HZ)) as graph:
            node, (publisher, bell) = join(graph.name, sensor)

            def send(frame):
                frame.header.schema = vigil.SensorFrame.SCHEMA
                publisher.loan_uninit().write_payload(frame).send()
                bell.notify()

            source, expected = Source(send), {}
            # The first frames may come before a reader is there.
            source.good(200)
            # Another epoch is another start here: the transport admits one publisher at a time.
            for cause, spoil in [bad for bad in BAD if bad[0] != "other-writer"]:
                send(spoil(source.next()))
                source.good()
                expected[cause] = expected.get(cause, 0) + (2 if cause == "jump" else 1)
            summary = graph.stop()
            del publisher, bell, node
        for name in ["detector", "identifier"]:
            self.assertEqual(summary["services"][name]["rejected"], expected, name)
        self.assertGreater(summary["services"]["supervisor"]["cycles"], 300)


# Cause of blindness, and how every frame of a drive is made to show nothing.
BLINDING = [
    ("clock", lambda f: change(f, header_t_capture_ns=f.header.t_capture_ns // 1000)),
    ("validity", lambda f: change(f, channel_valid=0)),
    ("command", lambda f: change(f, command_valid=0)),
    ("run", lambda f: change(f, run_id=1 + f.header.seq)),
]


class Blind(unittest.TestCase):
    """What passes every check and shows nothing is named, stops the robot, and fails the run."""

    def drive(self, seconds, rate_hz, spoil, run=STUCK_RUN):
        """The summary of a drive whose frames are spoilt."""
        with Graph("--source", "socket", "--rate", str(rate_hz)) as graph:
            address = graph.wait_for_socket()
            to = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
            self.addCleanup(to.close)
            frames = list(recording.frames(FRAMES, run))
            began = due = time.monotonic_ns()
            for seq in range(seconds * rate_hz):
                due += 10**9 // rate_hz
                time.sleep(max(0, due - time.monotonic_ns()) / 1e9)
                frame = vigil.SensorFrame.from_buffer_copy(frames[seq])
                frame.header.epoch, frame.header.seq, frame.run_id = began, seq, 1
                frame.header.t_schedule_ns = frame.header.t_capture_ns = due
                to.sendto(vigil.datagram(spoil(frame)), str(address))
            return graph.stop()

    def test_a_source_that_shows_nothing_is_named_and_the_robot_stops(self):
        for cause, spoil in BLINDING:
            with self.subTest(cause):
                summary = self.drive(2, RATE_HZ, spoil)
                self.assertEqual(list(summary["blind"]["detector"]), [cause])
                actions = [e["what"] for e in summary["events"] if e["event"] == "action"]
                self.assertEqual(actions[-1], "stop")

    def test_a_source_that_pauses_ends_nobody(self):
        with Graph("--source", "socket", "--rate", str(RATE_HZ)) as graph:
            address = graph.wait_for_socket()
            to = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
            self.addCleanup(to.close)
            source = Source(lambda frame: to.sendto(vigil.datagram(frame), str(address)))
            # Longer than the watchdog lets a service stand still while others go on.
            pauses_s = [3.0, 2.5]
            for pause_s in pauses_s:
                source.good(100)
                time.sleep(pause_s)
                source.due = time.monotonic_ns()
            source.good(100)
            told = [(e["service"], e["what"]) for e in graph.stop()["events"] if e["event"] in ("watchdog", "restarted")]
        self.assertEqual(told, [])

    def test_fields_of_another_unit_or_sign_are_told_by_the_graph(self):
        def millimetres(frame):
            frame.channel[0], frame.channel[1] = 1000 * frame.channel[0], 1000 * frame.channel[1]
            return frame

        summary = self.drive(4, 20, millimetres)
        told = [e["what"] for e in summary["events"] if e["event"] == "publisher"]
        self.assertTrue(any("are they in mm?" in what for what in told), told)
        self.assertEqual(list(summary["blind"]["detector"]), ["meaning"])
        summary = self.drive(3, 20, lambda f: change(f, channel=(ENC_RM, -f.channel[ENC_RM])))
        told = [e["what"] for e in summary["events"] if e["event"] == "publisher"]
        self.assertEqual(told, ["signs: enc_RM has the other sign"])


if __name__ == "__main__":
    unittest.main()
