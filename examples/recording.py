"""Frames of a recording of the rover (CSV.gz, columns as in tests/data/rover), one run of it."""

import csv
import gzip
import pathlib

import vigil_types as vigil


def frames(path, run, channels=None):
    """`channels`: the Channels of the graph; left out, those of rover.channels, beside this file."""
    channels = channels or vigil.Channels.read(pathlib.Path(__file__).with_name("rover.channels"))
    with gzip.open(path, "rt") as file:
        for row in csv.DictReader(file):
            if row["run"] != str(run):
                continue
            frame = vigil.SensorFrame(run_id=1 + run)
            frame.header.schema = vigil.SensorFrame.SCHEMA
            # From 1 on: a capture time of 0 is none.
            frame.header.t_capture_ns = 1 + round(float(row["t"]) * 1e9)
            # What is measured is set by its name, what is not stays 0.
            for name in channels.axes:
                channels.command(frame, name, float(row[name]))
            for name in channels.channels.keys() & row.keys():
                channels.set(frame, name, float(row[name]))
            yield frame
