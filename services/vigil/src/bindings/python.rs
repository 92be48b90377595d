//! The module for Python.

use std::fmt::Write as _;

use super::{Struct, constants, doc, elements, structs};

const HEAD: &str = r#""""Wire blocks of Vigil, as ctypes. Made by `vigil types python`; do not edit.

Units are SI, angles radians, times CLOCK_MONOTONIC nanoseconds; x forward, y left, yaw
counter-clockwise. All numbers little-endian, no padding. VALID_..._0 is the bit of the first
element of an array; shift it left for the others.
"""

import ctypes
import importlib.metadata
import os
import struct
import tempfile

"#;

/// What every publisher needs besides: where the graph lives, and the datagram.
const TAIL: &str = r#"

def runtime_folder(graph="rover"):
    """Folder of a running graph: its sockets and the files of its transport.

    Raises FileNotFoundError while there is none: the graph cleans up what joins before it.
    """
    user = os.environ.get("XDG_RUNTIME_DIR")
    candidates = ["/run/vigil"] + ([f"{user}/vigil"] if user else [])
    candidates.append(f"{tempfile.gettempdir()}/vigil-{os.getuid()}")
    for folder in candidates:
        try:
            os.stat(f"{folder}/{graph}/processes")
            return f"{folder}/{graph}"
        except FileNotFoundError:
            pass
        except PermissionError:
            raise PermissionError(f"{folder} is another user's: run as the user who runs the graph")
    raise FileNotFoundError(f"DoesNotExist: no graph '{graph}' is running (looked in {candidates})")


def transport(graph="rover"):
    """Configuration of iceoryx2 (package `iceoryx2`, version 0.10) with which to join the graph."""
    import iceoryx2

    config = iceoryx2.config.default()
    config.global_cfg.prefix = iceoryx2.FileName.new(f"vigil_{graph}_")
    config.global_cfg.root_path = iceoryx2.Path.new(f"{runtime_folder(graph)}/t")
    return config


def difference(kind, graph="rover"):
    """What is different between a running graph's type and ours, of the same name: a sentence."""
    with open(f"{runtime_folder(graph)}/types") as file:
        for line in file:
            name, size, alignment, version = line.split()
            if name.split(".")[1] == kind.__name__:
                theirs = f"{name}, {size} bytes, alignment {alignment} (iceoryx2 {version})"
    here = importlib.metadata.version("iceoryx2")
    ours = f"{kind.type_name()}, {ctypes.sizeof(kind)} bytes, alignment {ctypes.alignment(kind)}"
    change = "make vigil_types.py anew with 'vigil types python'"
    return f"the graph has {theirs}; this program has {ours} (iceoryx2 {here}): {change}"


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
    head = b"VGIL" + struct.pack("<HHI", 1, 1, len(body))
    return head + struct.pack("<I", crc32c(head + body)) + body
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
        let _ = writeln!(
            text,
            "        (\"{}\", {}{count}),",
            field.name,
            ctype(element)
        );
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
