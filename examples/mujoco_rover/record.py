"""Records healthy driving of the rover, as CSV of Vigil's recordings: frames and labels.

pip install mujoco==4.0.0
python3 record.py OUT [--runs 12] [--seconds 600] [--seed 1]
Writes OUT/mujoco_frames.csv.gz and OUT/mujoco_runs.csv. Every 3 to 10 s the rover gets another curvature and
speed, within the range that its shipped model was learned on. `scripts/bench field --only recorded/mujoco` judges the
runs, if OUT is $VIGIL_DATA/rover. Pose and encoders are judged by the shipped model. For gyro and currents every second
run is judged by a model learned from the others.
"""

import argparse
import csv
import gzip
import math
import pathlib

import numpy
from rover import EFFORT_NOISE, NOISE, NOISE_HZ, STEERED, WHEELS, Rover

HZ = 20.0
COMMAND_S, CURVATURE_1_M, SPEED_M_S = (3.0, 10.0), (-1.0, 1.0), (0.11, 0.29)
FRAMES = ["run", "t", "x", "y", "yaw", *(f"enc_{w}" for w in WHEELS), *(f"steer_{WHEELS[i]}" for i in STEERED)]
FRAMES += ["yaw_rate", *(f"current_{w}" for w in WHEELS), "cmd_curv", "cmd_speed"]
RUNS = ["run", "mode", "kind", "wheel", "onset_s", "cmd_curv", "cmd_speed", "dur_s", "terrain"]


def frames(run, seconds, random):
    """Rows of one run."""
    rover, root, until_s = Rover(), math.sqrt(HZ / NOISE_HZ), 0.0
    for k in range(1, round(seconds * HZ) + 1):
        if k / HZ > until_s:
            until_s += random.uniform(*COMMAND_S)
            curvature, speed = random.uniform(*CURVATURE_1_M), random.uniform(*SPEED_M_S)
        rover.drive(curvature, speed, 1.0 / HZ)
        sensed = rover.state() + root * NOISE * random.standard_normal(15)
        effort = rover.effort() + root * EFFORT_NOISE * random.standard_normal(7)
        sensed[2] = math.remainder(sensed[2], math.tau)
        steer = sensed[9:][STEERED]
        values = [f"{value:.5f}" for value in (*sensed[:9], *steer, *effort, *rover.command)]
        yield [run, f"{k / HZ:.2f}", *values]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--runs", type=int, default=12)
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--seed", type=int, default=1, help="of the first run; the others follow")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    with (
        gzip.open(options.out / "mujoco_frames.csv.gz", "wt", newline="") as rows,
        (options.out / "mujoco_runs.csv").open("w", newline="") as labels,
    ):
        rows, labels = csv.writer(rows), csv.writer(labels)
        rows.writerow(FRAMES)
        labels.writerow(RUNS)
        for run in range(options.runs):
            rows.writerows(frames(run, options.seconds, numpy.random.default_rng(options.seed + run)))
            labels.writerow([run, "ND", "", "", "-1.000", "0.00000", "0.2000", f"{options.seconds:.1f}", "mujoco"])
            print(f"run {run} is recorded", flush=True)


if __name__ == "__main__":
    main()
