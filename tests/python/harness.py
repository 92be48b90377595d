"""Starts graphs and publishers, and ends them."""

import json
import os
import pathlib
import shutil
import socket
import struct
import subprocess
import sys
import tempfile
import time
import uuid

ROOT = pathlib.Path(__file__).resolve().parents[2]
BINARIES = ROOT / "target" / "debug"
EXAMPLES = ROOT / "examples"
FRAMES = ROOT / "tests" / "data" / "rover" / "learn_frames.csv.gz"
# Of a run in which the left front wheel sticks, and which the shipped model has not seen.
STUCK_RUN, STUCK_LEAF = 3, "LF_STUCK"
# A test that hangs is ended after this long.
WATCHDOG_S = 120

sys.path.insert(0, str(EXAMPLES))


def vigil(*arguments):
    command = [BINARIES / "vigil", *arguments]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=WATCHDOG_S)


def wait_for(look, what):
    """Until `look` finds something; what it was."""
    until = time.monotonic() + WATCHDOG_S
    while time.monotonic() < until:
        found = look()
        if found:
            return found
        time.sleep(0.05)
    raise TimeoutError(what)


def publisher(name, *arguments):
    """A publisher of examples/ as a process."""
    command = [sys.executable, EXAMPLES / name, *map(str, arguments)]
    return subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)


class Graph:
    """A graph of its own name on the default configuration; stopped at the end of a `with`."""

    def __init__(self, *options, name=None, recordings=None, before_s=3.0, after_s=1.0):
        self.name = name or f"py{os.getpid()}-{uuid.uuid4().hex[:6]}"
        self.options = options
        # Folder of the black box, if it is to run.
        self.recordings, self.before_s, self.after_s = recordings, before_s, after_s
        # A port of its own: another graph may be taking datagrams on this machine.
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
            free.bind(("127.0.0.1", 0))
            self.udp_port = free.getsockname()[1]

    def __enter__(self):
        self.folder = tempfile.TemporaryDirectory()
        config = pathlib.Path(self.folder.name) / "config"
        shutil.copytree(ROOT / "config", config)
        with open(config / "rover.toml", "a") as file:
            file.write(f'\n[sensor.socket]\nudp = "127.0.0.1:{self.udp_port}"\n')
            if self.recordings:
                times = f"before_s = {self.before_s}\nafter_s = {self.after_s}\n"
                file.write(f'[blackbox]\nfolder = "{self.recordings}"\n{times}')
        command = [BINARIES / "vigil-launcher", "--json", "--config", config / "rover.toml"]
        command += [] if self.recordings else ["--no-blackbox"]
        command += ["--graph", self.name, *self.options]
        self.launcher = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        return self

    def wait_until_up(self):
        """Until its services are being started; its folder."""
        import vigil_types

        until = time.monotonic() + WATCHDOG_S
        while time.monotonic() < until:
            assert self.launcher.poll() is None, self.launcher.stderr.read()
            try:
                return pathlib.Path(vigil_types.runtime_folder(self.name))
            except FileNotFoundError:
                time.sleep(0.05)
        raise TimeoutError("the graph did not come up")

    def wait_for_socket(self):
        """Until it takes datagrams; the path of its Unix socket."""
        address = self.wait_until_up() / "sensor.sock"
        until = time.monotonic() + WATCHDOG_S
        while not address.exists():
            assert self.launcher.poll() is None, self.launcher.stderr.read()
            assert time.monotonic() < until, "the socket did not appear"
            time.sleep(0.02)
        return address

    def told(self, kind):
        """The services of which it has told events of a kind so far, and what it said of each."""
        told = vigil("events", "--json", "--graph", self.name).stdout.splitlines()
        return [(event["service"], event["what"]) for event in map(json.loads, told) if event["event"] == kind]

    def wait_until_armed(self):
        """Until its robot drives, and is watched; its folder."""
        folder = self.wait_until_up()
        wait_for(lambda: self.told("armed"), "a drive")
        return folder

    def listed(self):
        """What `vigil list` says of it, if it runs."""
        from schemas import problems

        document = json.loads(vigil("list", "--json").stdout)
        assert not (wrong := problems("list", document)), wrong
        return next((of for of in document["graphs"] if of["name"] == self.name), None)

    def pid(self, service):
        """The process of a service."""
        return next(of["pid"] for of in self.listed()["services"] if of["name"] == service)

    def finish(self):
        """Waits for the end; the summary."""
        out, err = self.launcher.communicate(timeout=WATCHDOG_S)
        summary = json.loads(out)
        # A graph that was blind for a while has had a failure.
        saw_all = summary["duration_s"] > 0 and not summary["blind"]
        assert self.launcher.returncode == (0 if saw_all else 1), err
        return summary

    def stop(self):
        """Asks it to stop; the summary."""
        self.launcher.terminate()
        return self.finish()

    def __exit__(self, *_):
        if self.launcher.poll() is None:
            self.launcher.terminate()
            try:
                self.launcher.communicate(timeout=20)
            except subprocess.TimeoutExpired:
                self.launcher.kill()
                self.launcher.communicate()
        self.folder.cleanup()


def events(summary, kind):
    return [event["what"] for event in summary["events"] if event["event"] == kind]


def datagram_of(verdict):
    """The datagram in which a graph sends a verdict."""
    import vigil_types

    verdict.header.schema = vigil_types.Verdict.SCHEMA
    body = bytes(verdict)
    head = b"VGIL" + struct.pack("<HHI", 2, 2, len(body))
    return head + struct.pack("<I", vigil_types.crc32c(head + body)) + body
