//! The module for Python.

use std::fmt::Write as _;

use super::{Struct, constants, doc, elements, is_text, structs};

const HEAD: &str = r#""""Wire blocks of Vigil, as ctypes. Made by `vigil types python`; do not edit.

Units are SI, angles radians, times CLOCK_MONOTONIC nanoseconds; x forward, y left, yaw
counter-clockwise. All numbers little-endian, no padding. Channels finds the places of a frame's
command and channels by their names.
"""

import ctypes
import importlib.metadata
import os
import struct
import tempfile

"#;

/// What every publisher needs besides: where the graph lives, and the datagrams.
const TAIL: &str = r#"

def _folders():
    """Where the folders of graphs lie."""
    user = os.environ.get("XDG_RUNTIME_DIR")
    folders = ["/run/vigil"] + ([f"{user}/vigil"] if user else [])
    return folders + [f"{tempfile.gettempdir()}/vigil-{os.getuid()}"]


def _is_running(folder):
    """True if a launcher or a service holds the lock of a graph: what was killed left its files."""
    import fcntl

    try:
        os.stat(f"{folder}/processes")
        with open(f"{folder}/lock") as lock:
            fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        pass
    return False


def running_graphs():
    """Names of the running graphs that this user may join."""
    found = []
    for folder in _folders():
        try:
            found += [name for name in os.listdir(folder) if _is_running(f"{folder}/{name}")]
        except OSError:
            pass
    return sorted(found)


def runtime_folder(graph="rover"):
    """Folder of a running graph: its sockets and the files of its transport.

    Raises FileNotFoundError while there is none: the graph cleans up what joins before it.
    """
    closed = None
    for folder in _folders():
        try:
            os.stat(f"{folder}/{graph}/processes")
            if _is_running(f"{folder}/{graph}"):
                return f"{folder}/{graph}"
        except FileNotFoundError:
            pass
        except PermissionError:
            closed = folder
    if closed is not None:
        other = f"{closed} is another user's"
        raise PermissionError(f"no graph '{graph}' of yours is running, and {other}")
    raise FileNotFoundError(f"no graph '{graph}' is running (looked in {_folders()})")


def transport(graph="rover"):
    """Configuration of iceoryx2 (package `iceoryx2`, version 0.10) with which to join the graph."""
    import iceoryx2

    folder, start = runtime_folder(graph), ""
    try:
        # Each start of a graph has files of its own names.
        with open(f"{folder}/start") as file:
            start = file.read()
    except FileNotFoundError:
        pass
    config = iceoryx2.config.default()
    config.global_cfg.prefix = iceoryx2.FileName.new(f"vigil_{graph}_{start}")
    config.global_cfg.root_path = iceoryx2.Path.new(f"{folder}/t")
    return config


def difference(graph="rover"):
    """What is different between a running graph's types and ours: a sentence."""
    with open(f"{runtime_folder(graph)}/types") as file:
        theirs = {line.split(".")[1]: line.split() for line in file}
    here, there = importlib.metadata.version("iceoryx2"), theirs["SensorFrame"][3]
    for kind in (SensorFrame, Action):
        ours = [kind.type_name(), str(ctypes.sizeof(kind)), str(ctypes.alignment(kind))]
        if ours != theirs[kind.__name__][:3]:
            words = "{}, {} bytes, alignment {} (iceoryx2 {})"
            graphs = "the graph has " + words.format(*theirs[kind.__name__])
            program = "this program has " + words.format(*ours, here)
            return f"{graphs}; {program}: make vigil_types.py anew with 'vigil types python'"
    return f"the types are the same; the graph has iceoryx2 {there}, this program {here}"


class Channels:
    """Which place of a frame's command and channels has which name: a robot's channel list.

    Made of the text that `vigil channels --robot F` prints; Channels.read(path) makes it of a file.
    `axes` and `channels` are the places by name, `units` the units by name, `-` for none.
    """

    def __init__(self, text):
        self.robot_hash, self.axes, self.channels, self.units = 0, {}, {}, {}
        for line in text.splitlines():
            kind, number, name, *unit = line.split()
            if kind == "robot":
                self.robot_hash = int(number, 16)
            elif kind in ("command", "channel"):
                (self.axes if kind == "command" else self.channels)[name] = int(number)
                self.units[name] = " ".join(unit)
        if self.robot_hash == 0:
            raise ValueError("no channel list: it has no line 'robot HASH NAME'")

    @staticmethod
    def read(path):
        """The list of a file."""
        with open(path) as file:
            return Channels(file.read())

    def set(self, frame, name, value):
        """Writes a channel and marks it as measured; KeyError with the names that there are."""
        place = self._place(self.channels, name)
        frame.channel[place] = value
        frame.channel_valid |= 1 << place
        frame.robot_hash = self.robot_hash

    def command(self, frame, name, value):
        """Writes an axis of the command and marks it as known; KeyError as above."""
        place = self._place(self.axes, name)
        frame.command[place] = value
        frame.command_valid |= 1 << place
        frame.robot_hash = self.robot_hash

    @staticmethod
    def _place(places, name):
        if name not in places:
            raise KeyError(f"'{name}' is none of {', '.join(places)}")
        return places[name]


def channel_list(graph="rover"):
    """The Channels of a running graph."""
    return Channels.read(f"{runtime_folder(graph)}/channels")


def addresses(graph="rover"):
    """Where a running graph takes datagrams: host:port or a path. LookupError if it takes none."""
    try:
        with open(f"{runtime_folder(graph)}/addresses") as file:
            found = [line.split(None, 1)[1].strip() for line in file]
    except FileNotFoundError:
        # That there is no graph is another answer.
        runtime_folder(graph)
        found = []
    if not found:
        raise LookupError(f"graph '{graph}' takes no datagrams")
    return found


def _table():
    for byte in range(256):
        for _ in range(8):
            byte = (byte >> 1) ^ (0x82F63B78 if byte & 1 else 0)
        yield byte


_CRC_TABLE = tuple(_table())


def crc32c(data):
    """CRC-32C (Castagnoli)."""
    crc = 0xFFFFFFFF
    for byte in data:
        crc = _CRC_TABLE[(crc ^ byte) & 0xFF] ^ (crc >> 8)
    return crc ^ 0xFFFFFFFF


def datagram(frame):
    """The datagram of a SensorFrame, for the sockets of `sensor.source = "socket"`.

    The sender fills in header.epoch (not 0, another at each start), header.seq and
    header.t_capture_ns; it leaves header.t_schedule_ns at 0 unless it runs on Vigil's machine.
    """
    frame.header.schema = SensorFrame.SCHEMA
    body = bytes(frame)
    head = _head(1, len(body))
    return head + struct.pack("<I", crc32c(head + body)) + body


def _head(kind, size):
    return b"VGIL" + struct.pack("<HHI", 2, kind, size)


def verdict_of(data):
    """The Verdict of a datagram that came back; None if it is none.

    A robot obeys it for valid_for_ns from its arrival, and stops after that.
    """
    head, size = _head(2, ctypes.sizeof(Verdict)), ctypes.sizeof(Verdict)
    if len(data) != 16 + size or data[:12] != head:
        return None
    if struct.unpack("<I", data[12:16])[0] != crc32c(head + data[16:]):
        return None
    verdict = Verdict.from_buffer_copy(data[16:])
    return verdict if verdict.header.schema == Verdict.SCHEMA else None
"#;

/// The whole module.
pub fn module() -> String {
    let mut text = String::from(HEAD);
    for (prefix, name, value) in constants() {
        let _ = writeln!(text, "{prefix}_{name} = {value}");
    }
    for item in structs() {
        one(&item, &mut text);
    }
    text.push_str(TAIL);
    text
}

fn one(item: &Struct, text: &mut String) {
    let name = item.name;
    let _ = writeln!(text, "\n\nclass {name}(ctypes.LittleEndianStructure):");
    if let Some((schema, type_name)) = item.block {
        let _ = writeln!(text, "    SCHEMA = 0x{schema:016X}");
        let _ = writeln!(text, "    TYPE_NAME = \"{type_name}\"\n");
        let _ = writeln!(text, "    @staticmethod");
        let _ = writeln!(text, "    def type_name():");
        let _ = writeln!(text, "        return {name}.TYPE_NAME\n");
    }
    let _ = writeln!(text, "    _fields_ = [");
    for field in item.fields {
        let (element, count) = elements(field);
        let count = count.map_or_else(String::new, |n| format!(" * {n}"));
        let _ = writeln!(text, "        # {}", doc(field));
        let ctype = if is_text(field) {
            "ctypes.c_char".into()
        } else {
            ctype(element)
        };
        let _ = writeln!(text, "        (\"{}\", {ctype}{count}),", field.name);
    }
    let _ = writeln!(text, "    ]\n\n");
    let _ = writeln!(text, "assert ctypes.sizeof({name}) == {}", item.size);
    for field in item.fields {
        let _ = writeln!(
            text,
            "assert {name}.{}.offset == {}",
            field.name, field.offset
        );
    }
}

fn ctype(rust: &str) -> String {
    match rust {
        "f64" => "ctypes.c_double".into(),
        "f32" => "ctypes.c_float".into(),
        "u64" | "u32" | "u16" | "u8" => format!("ctypes.c_uint{}", &rust[1..]),
        "i64" | "i32" | "i16" | "i8" => format!("ctypes.c_int{}", &rust[1..]),
        name => name.into(),
    }
}
