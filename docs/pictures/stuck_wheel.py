"""Draws docs/pictures/stuck-wheel.svg: how Vigil diagnoses one recorded run with a stuck wheel.

    python3 docs/pictures/stuck_wheel.py target/release/vigil docs/pictures/stuck-wheel.svg

The run is one that the model was not learned from. Needs only Python's own library.
"""

import csv
import gzip
import math
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT / "tests/data/rover"
# A gentle turn to the right in which the pose alone first names a side, then the wheel.
RUN = "163"
WHEELS = ["LF", "LM", "LR", "RF", "RM", "RR"]
# Seconds that are drawn, counted from the onset.
FROM_S, TO_S = -0.5, 1.9
WIDTH, HEIGHT = 1000, 560
# The drawing area of the panels over time; the path is left of them.
LEFT, RIGHT = 400, 975

INK, QUIET, RULE, PAPER = "#1c2733", "#6b7a89", "#dfe5ea", "#ffffff"
FAULT, SIDE, ALARM, ACTION = "#d1495b", "#f3b8a8", "#e28413", "#2e7d6b"
ACTION_COLOURS = {"go_on": "#cfd8df", "slow_down": "#9fc5b8"}


def run_rows(path):
    with gzip.open(path, "rt") as file:
        return [row for row in csv.DictReader(file) if row["run"] == RUN]


def label():
    with open(DATA / "learn_runs.csv") as file:
        return next(row for row in csv.DictReader(file) if row["run"] == RUN)


def verdicts(vigil, frames, sensors, folder):
    """Rows of `vigil diagnose` over the run."""
    source, out = folder / "frames.csv", folder / "verdicts.csv"
    with open(source, "w", newline="") as file:
        writer = csv.DictWriter(file, frames[0].keys())
        writer.writeheader()
        writer.writerows(frames)
    command = [vigil, "diagnose", "--model", ROOT / "config/models/rover.toml"]
    command += ["--robot", ROOT / "config/robots/rover.toml"]
    command += ["--tree", ROOT / "config/trees/rover.toml"]
    command += ["--decision", ROOT / "config/rover.pomdp"]
    command += ["--frames", source, "--sensors", sensors, "--out", out]
    subprocess.run([str(word) for word in command], check=True, stderr=subprocess.DEVNULL)
    with open(out) as file:
        return list(csv.DictReader(file))


class Drawing:
    """SVG elements, one a line."""

    def __init__(self):
        self.lines = []

    def add(self, element):
        self.lines.append(element)

    def text(self, x, y, words, colour=INK, size=13, anchor="start", weight="normal"):
        words = words.replace("&", "&amp;").replace("<", "&lt;")
        self.add(
            f'<text x="{x:.1f}" y="{y:.1f}" fill="{colour}" font-size="{size}" '
            f'text-anchor="{anchor}" font-weight="{weight}">{words}</text>'
        )

    def line(self, points, colour, width=1.5, dash=""):
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
        dash = f' stroke-dasharray="{dash}"' if dash else ""
        self.add(
            f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="{width}" '
            f'stroke-linejoin="round" stroke-linecap="round"{dash}/>'
        )

    def area(self, points, base, colour):
        path = [(points[0][0], base), *points, (points[-1][0], base)]
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in path)
        self.add(f'<polygon points="{path}" fill="{colour}"/>')

    def bar(self, x, y, width, height, colour, radius=3.0):
        self.add(
            f'<rect x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}" '
            f'rx="{radius}" fill="{colour}"/>'
        )

    def svg(self):
        head = (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" '
            f'width="{WIDTH}" height="{HEIGHT}" '
            'font-family="Inter, Helvetica, Arial, DejaVu Sans, sans-serif">'
        )
        paper = f'<rect width="{WIDTH}" height="{HEIGHT}" rx="10" fill="{PAPER}"/>'
        title = "<title>A recorded rover whose right middle wheel sticks</title>"
        return "\n".join([head, title, paper, *self.lines, "</svg>", ""])


class TimeAxis:
    def __init__(self, onset_s):
        self.onset_s = onset_s

    def x(self, t_s):
        return LEFT + (t_s - self.onset_s - FROM_S) / (TO_S - FROM_S) * (RIGHT - LEFT)

    def shown(self, rows):
        inside = (FROM_S - 0.05, TO_S + 0.001)
        return [r for r in rows if inside[0] <= float(r["t"]) - self.onset_s <= inside[1]]


def commanded_path(frames):
    """Where the commands lead from the first measured pose on."""
    x, y, yaw = (float(frames[0][key]) for key in ("x", "y", "yaw"))
    points = [(x, y)]
    for before, now in zip(frames, frames[1:]):
        distance = float(before["cmd_speed"]) * (float(now["t"]) - float(before["t"]))
        yaw += 0.5 * distance * float(before["cmd_curv"])
        x, y = x + distance * math.cos(yaw), y + distance * math.sin(yaw)
        yaw += 0.5 * distance * float(before["cmd_curv"])
        points.append((x, y))
    return points


def draw_path(drawing, frames, onset_s):
    """Commanded and driven path, seen from above; the start points up."""
    driven = [(float(row["x"]), float(row["y"])) for row in frames]
    commanded = commanded_path(frames)
    up = math.pi / 2 - float(frames[0]["yaw"])
    turned = [
        [
            (x * math.cos(up) - y * math.sin(up), x * math.sin(up) + y * math.cos(up))
            for x, y in points
        ]
        for points in (driven, commanded)
    ]
    xs, ys = zip(*[point for points in turned for point in points])
    scale = min(255 / (max(xs) - min(xs)), 400 / (max(ys) - min(ys)))

    def place(point):
        x = 55 + (point[0] - min(xs)) * scale
        return x, 520 - (point[1] - min(ys)) * scale

    onset = next(i for i, row in enumerate(frames) if float(row["t"]) >= onset_s)
    path, plan = ([place(point) for point in points] for points in turned)
    drawing.text(30, 78, "Seen from above", weight="bold")
    drawing.line(plan, QUIET, 2, "2 6")
    drawing.line(path[: onset + 1], INK, 2.5)
    drawing.line(path[onset:], FAULT, 2.5)
    x, y = path[onset]
    drawing.add(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="5" fill="{FAULT}"/>')
    drawing.text(x + 14, y + 5, "the wheel jams", FAULT)
    for points, words, colour in ((plan, "commanded", QUIET), (path, "driven", FAULT)):
        x, y = points[-1]
        drawing.text(x + 8, y + 4, words, colour)
    drawing.bar(30, 538, scale * 0.5, 2, QUIET, 0)
    drawing.text(30 + scale * 0.5 + 8, 543, "0.5 m", QUIET, 12)


def draw_rates(drawing, axis, frames, top, height):
    rows = axis.shown(frames)
    highest = max(float(row[f"enc_{wheel}"]) for row in rows for wheel in WHEELS) * 1.08

    def points(wheel):
        return [
            (axis.x(float(row["t"])), top + height * (1 - float(row[f"enc_{wheel}"]) / highest))
            for row in rows
        ]

    for wheel in WHEELS:
        if wheel != "RM":
            drawing.line(points(wheel), "#b5c0ca", 1.5)
    drawing.line(points("RM"), FAULT, 2.5)
    drawing.line([(LEFT, top + height), (RIGHT, top + height)], RULE, 1)
    drawing.text(LEFT, top - 8, "Wheel rates", weight="bold")
    drawing.text(RIGHT, top + height - 8, "right middle", FAULT, 12, "end")
    drawing.text(RIGHT, top - 8, "the other five", QUIET, 12, "end")


def spans(axis, rows, value):
    """Stretches of time over which `value` of a row stays: (value, first x, last x)."""
    found = []
    for row in rows:
        x = max(LEFT, axis.x(float(row["t"])))
        if found and found[-1][0] == value(row):
            found[-1][2] = x
        else:
            if found:
                found[-1][2] = x
            found.append([value(row), x, x])
    return found


def draw_belief(drawing, axis, rows, top, height, heading):
    rows = axis.shown(rows)
    base = top + height

    def curve(value):
        return [(max(LEFT, axis.x(float(r["t"]))), base - height * value(r)) for r in rows]

    for part in (0.0, 0.5, 1.0):
        y = base - height * part
        drawing.line([(LEFT, y), (RIGHT, y)], RULE, 1)
        drawing.text(LEFT - 8, y + 4, f"{part:g}", QUIET, 11, "end")
    drawing.area(curve(lambda row: float(row["p_right_stuck"])), base, SIDE)
    # `p_mode` is the wheel's probability while the wheel is what `mode` names.
    start = next(i for i, row in enumerate(rows) if row["mode"] == "RM_STUCK")
    end = next((i for i in range(start, len(rows)) if rows[i]["mode"] != "RM_STUCK"), len(rows))
    drawing.area(curve(lambda row: float(row["p_mode"]))[start:end], base, FAULT)
    drawing.line(curve(lambda row: float(row["p_fault"])), ALARM, 2)
    drawing.text(LEFT, top - 10, heading, weight="bold")
    x = axis.x(axis.onset_s + 0.95)
    drawing.text(x, base - 12, "the right middle wheel is stuck", PAPER, 12)
    if float(rows[-1]["p_mode"]) < 0.9:
        drawing.text(x, top + 19, "or another wheel of that side", INK, 12)
    x = next(x for x, y in curve(lambda row: float(row["p_fault"])) if y < top + 0.6 * height)
    # Left of the curve, and not across the line of the onset.
    onset_x = axis.x(axis.onset_s)
    x = x - 10 if x - 60 > onset_x else onset_x - 8
    drawing.text(x, top + 16, "fault", ALARM, 12, "end")
    alarm = next(row for row in rows if row["alarm"] == "1")
    named = next(row for row in rows if row["reported"] == "RM_STUCK")
    for row, words in ((alarm, "alarm"), (named, "named")):
        delay = float(row["t"]) - axis.onset_s
        yield float(row["t"]), f"{words} after {delay:.2f} s"
    for row_top, value in ((base + 6, "reported"), (base + 26, "action")):
        drawing.text(LEFT - 8, row_top + 12, value, QUIET, 11, "end")
        for name, start, end in spans(axis, rows, lambda row: row[value]):
            draw_span(drawing, name, start, end, row_top, value)


def draw_span(drawing, name, start, end, top, kind):
    colours = {"ND": "#cfd8df", "RSS": SIDE, "RM_STUCK": FAULT}
    colour = colours.get(name, FAULT) if kind == "reported" else ACTION_COLOURS.get(name, ACTION)
    drawing.bar(start, top, max(end - start - 1, 1), 16, colour)
    strong = colour in (FAULT, ACTION)
    # About 6.3 units a letter.
    spare = end - start - 6.3 * len(name)
    if spare > 2:
        drawing.text(start + min(6, spare / 2), top + 12, name, PAPER if strong else INK, 11)


def main():
    vigil, out = sys.argv[1:]
    onset_s = float(label()["onset_s"])
    frames = run_rows(DATA / "learn_frames.csv.gz")
    drawing = Drawing()
    axis = TimeAxis(onset_s)
    drawing.text(30, 40, "A rover's right middle wheel sticks", size=20, weight="bold")
    drawing.text(
        RIGHT, 40, "recorded run 163, an independent physics engine", QUIET, 12, "end"
    )
    draw_path(drawing, frames, onset_s)
    x = axis.x(onset_s)
    for top, bottom in ((86, 170), (206, 336), (386, 522)):
        drawing.line([(x, top), (x, bottom)], FAULT, 1.2, "3 4")
    draw_rates(drawing, axis, frames, 86, 76)
    panels = (
        ("pose+encoders", "With wheel encoders", 206),
        ("pose", "From the pose alone", 386),
    )
    with tempfile.TemporaryDirectory() as folder:
        for sensors, heading, top in panels:
            rows = verdicts(vigil, frames, sensors, Path(folder))
            marks = list(draw_belief(drawing, axis, rows, top, 84, heading))
            words = ", ".join(mark for _, mark in marks)
            drawing.text(RIGHT, top - 10, words, INK, 12, "end")
    for half_seconds in range(math.ceil(2 * FROM_S), math.floor(2 * TO_S) + 1):
        x = axis.x(onset_s + half_seconds / 2)
        words = f"{half_seconds / 2:+g} s" if half_seconds else "onset"
        drawing.text(x, 540, words, QUIET, 11, "middle")
    Path(out).write_text(drawing.svg())


if __name__ == "__main__":
    main()
