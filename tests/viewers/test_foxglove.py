"""Recordings of the black box are decoded by the libraries that Foxglove is made of."""

import collections
import json
import subprocess
import unittest

from recordings import recordings  # It says where the harness lies.

from harness import ROOT, WATCHDOG_S
from mcap.reader import make_reader

# The libraries, as scripts/test has installed them, and what reads a recording with them.
FOLDER = ROOT / "target" / "foxglove"


def decoded(recording):
    command = ["node", FOLDER / "read.mjs", recording]
    read = subprocess.run(command, capture_output=True, text=True, timeout=WATCHDOG_S)
    assert read.returncode == 0, read.stderr
    return json.loads(read.stdout)


def counted(recording):
    """Messages of each topic in the words of ROS 2, by a reader that does not decode them."""
    with open(recording, "rb") as file:
        messages = make_reader(file).iter_messages()
        cdr = (channel.topic for _, channel, _ in messages if channel.message_encoding == "cdr")
        return dict(collections.Counter(cdr))


@unittest.skipUnless((FOLDER / "node_modules").is_dir(), "scripts/test --viewers has not installed them")
class Foxglove(unittest.TestCase):
    def test_every_message_of_every_recording_is_decoded(self):
        for recording in recordings():
            with self.subTest(recording.name):
                found = decoded(recording)
                self.assertEqual(found["profile"], "ros2")
                self.assertEqual(found["counts"], counted(recording))
                self.assertGreater(len(found["counts"]), 10)

    def test_the_fault_has_its_name_at_the_end(self):
        belief = decoded(recordings().alarm)["belief"]
        self.assertGreater(belief["RM_STUCK"], 0.9, belief)


if __name__ == "__main__":
    unittest.main()
