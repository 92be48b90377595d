"""Frames of a recording of the rover (CSV.gz, columns as in tests/data/rover), one run of it."""

import csv
import gzip

import vigil_types as vigil

WHEELS = ["LF", "LM", "LR", "RF", "RM", "RR"]


def frames(path, run):
    with gzip.open(path, "rt") as file:
        for row in csv.DictReader(file):
            if row["run"] != str(run):
                continue
            frame = vigil.SensorFrame(run_id=1 + run)
            frame.header.schema = vigil.SensorFrame.SCHEMA
            frame.header.t_capture_ns = round(float(row["t"]) * 1e9)
            # What is measured is marked, what is not stays 0.
            frame.valid = vigil.VALID_POSE | 3 * vigil.VALID_COMMAND_0
            frame.command[:2] = float(row["cmd_curv"]), float(row["cmd_speed"])
            frame.pose[:] = float(row["x"]), float(row["y"]), float(row["yaw"])
            for i, wheel in enumerate(WHEELS):
                frame.wheel_rate[i] = float(row[f"enc_{wheel}"])
                frame.valid |= vigil.VALID_WHEEL_RATE_0 << i
                if f"steer_{wheel}" in row:
                    frame.steer[i] = float(row[f"steer_{wheel}"])
                    frame.valid |= vigil.VALID_STEER_0 << i
            yield frame
