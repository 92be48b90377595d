"""Shows a recording in the viewer Rerun: wheels, beliefs and decisions as named curves, and events.

pip install rerun-sdk==0.41.0
python3 rerun_layout.py FILE.mcap [URL]

URL is that of a viewer that runs, as rerun+http://127.0.0.1:9876/proxy. Without it one is opened.
"""

import itertools
import pathlib
import shutil
import sys

import rerun
from rerun import blueprint

# Of the curves of a plot, in their order; after the last one they begin anew.
COLOURS = [
    list(bytes.fromhex(colour))
    for colour in (
        "1f77b4 ff7f0e 2ca02c d62728 9467bd 8c564b e377c2 7f7f7f bcbd22 17becf "
        "aec7e8 ffbb78 98df8a ff9896 c5b0d5 c49c94 f7b6d2 c7c7c7 dbdb8d 9edae5"
    ).split()
]
CURVES_MAX = 64


def plot(name, entity, width, axis=None):
    """The numbers of an entity, each as a curve by the name that the recording has for it."""
    colours = list(itertools.islice(itertools.cycle(COLOURS), CURVES_MAX))
    style = {entity: rerun.SeriesLines(colors=colours, widths=[width] * CURVES_MAX)}
    return blueprint.TimeSeriesView(name=name, origin=entity, overrides=style, axis_y=axis)


def layout():
    probability = blueprint.ScalarAxis(range=(-0.02, 1.02))
    wheels = plot("wheels, rad/s", "/joint_states/velocity", 1)
    belief = plot("belief", "/vigil/belief/position", 2, probability)
    decision = plot("decision", "/vigil/decision/position", 2, probability)
    columns = blueprint.TextLogColumns(text_log_columns=["loglevel", "body"])
    events = blueprint.TextLogView(name="events", origin="/vigil/events", columns=columns)
    last = blueprint.Horizontal(decision, events)
    rows = blueprint.Vertical(wheels, belief, last, row_shares=[3, 5, 3])
    return blueprint.Blueprint(rows, collapse_panels=True)


def show(path, url=None):
    stream = rerun.RecordingStream("vigil")
    if url:
        stream.connect_grpc(url, default_blueprint=layout())
    else:
        # Beside this Python, where pip puts it, or else where the shell would find it.
        program = shutil.which("rerun", path=pathlib.Path(sys.executable).parent)
        rerun.spawn(recording=stream, executable_path=program, default_blueprint=layout())
    stream.log_file_from_path(path)
    # This waits until all of it is sent.
    stream.disconnect()


if __name__ == "__main__":
    show(*sys.argv[1:3])
