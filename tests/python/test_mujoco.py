"""The rover of examples/mujoco_rover, in a physics engine: that it drives as a rover does, and that a graph finds
what breaks in it and is obeyed."""

import importlib.util
import math
import re
import subprocess
import sys
import unittest

from harness import EXAMPLES, ROOT, WATCHDOG_S, Graph, events

FOLDER = EXAMPLES / "mujoco_rover"
IS_THERE = importlib.util.find_spec("mujoco") is not None
if not IS_THERE:
    print(f"{__file__}: SKIPPED, the package mujoco is not installed", file=sys.stderr)
RATE_HZ, DRIVE_S = 100, 15


def driven(curvature, speed, stuck=None):
    """Heading rate and speed of the rover in the steady state."""
    from rover import WHEELS, Rover

    rover = Rover()
    if stuck is not None:
        rover.stick(WHEELS.index(stuck), True)
    rover.drive(curvature, speed, 3.0)
    x, y, yaw = rover.state()[:3]
    rover.drive(curvature, speed, 1.0)
    x_after, y_after, yaw_after = rover.state()[:3]
    return yaw_after - yaw, math.hypot(x_after - x, y_after - y)


def may_have_real_time():
    """True if a process of ours is given what the services ask for."""
    code = "import os; os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(55))"
    return subprocess.run([sys.executable, "-c", code], capture_output=True).returncode == 0


@unittest.skipUnless(IS_THERE, "the package mujoco is not installed")
class Physics(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        sys.path.insert(0, str(FOLDER))

    def test_each_wheel_carries_a_sixth_of_the_weight(self):
        from rover import Rover

        for load in Rover().loads():
            self.assertAlmostEqual(load, 14.2 * 9.81 / 6, delta=0.1)

    def test_a_healthy_rover_drives_what_it_is_told(self):
        for curvature in [0.5, 0.0, -0.4]:
            heading_rate, speed = driven(curvature, 0.2)
            self.assertAlmostEqual(heading_rate, 0.2 * curvature, delta=0.001)
            self.assertAlmostEqual(speed, 0.2, delta=0.002)

    def test_a_stuck_wheel_pulls_to_its_side_as_much_as_in_vigils_own_model(self):
        # Curvature 0.5 1/m to the left at 0.2 m/s, rad/s.
        wanted = {"LF": 0.122, "LM": 0.132, "LR": 0.111, "RF": 0.049, "RM": 0.059, "RR": 0.076}
        for wheel, heading_rate in wanted.items():
            with self.subTest(wheel):
                self.assertAlmostEqual(driven(0.5, 0.2, wheel)[0], heading_rate, delta=0.003)


@unittest.skipUnless(IS_THERE, "the package mujoco is not installed")
class ClosedLoop(unittest.TestCase):
    def test_a_stuck_wheel_is_found_and_the_rover_obeys(self):
        with Graph("--source", "external", "--rate", str(RATE_HZ)) as graph:
            options = ["--graph", graph.name, "--hz", str(RATE_HZ), "--seconds", str(DRIVE_S)]
            command = [sys.executable, FOLDER / "drive.py", *options, "--break", "stuck:RM@5"]
            # Nobody types.
            pipes = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
            done = subprocess.run(command, cwd=ROOT, text=True, timeout=WATCHDOG_S, **pipes)
            self.assertEqual(done.returncode, 0, done.stderr)
            summary = graph.stop()
        self.assertTrue(events(summary, "alarm"), summary["events"])
        self.assertIn("RM_STUCK", events(summary, "diagnosis"))
        detector = summary["services"]["detector"]
        self.assertEqual((detector["lost"], detector["rejected"]), (0, {}))
        # Every frame that was sent, but for those before the detector was there. How many
        # periods were slept through depends on the machine.
        slept = int(re.search(r"(\d+) periods were slept through", done.stdout)[1])
        self.assertGreater(detector["cycles"], DRIVE_S * RATE_HZ - slept - RATE_HZ)
        self.assertGreater(detector["cycles"], 0.5 * DRIVE_S * RATE_HZ)
        if may_have_real_time():
            for name, service in summary["services"].items():
                self.assertRegex(service["scheduling"], "^fifo", name)
        # It drove until the wheel broke, and counter-steered after that.
        before, after = done.stdout.split("s: stuck RM\n")
        self.assertIn("obeys go_on:", before)
        self.assertNotIn("obeys compensate", before)
        self.assertIn("obeys compensate RM:", after)


if __name__ == "__main__":
    unittest.main()
