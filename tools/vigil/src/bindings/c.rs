//! The header for C and C++.

use std::fmt::Write as _;

use vigil_blocks::datagram::{DATAGRAM_SIZE, VERDICT_DATAGRAM_SIZE};

use super::{Struct, constants, doc, elements, is_text, structs};

const HEAD: &str = r#"/* Wire blocks of Vigil, for C11 and C++17.
 * Made by `vigil types c`; do not edit.
 *
 * Units are SI, angles radians, times CLOCK_MONOTONIC nanoseconds; x forward, y left, yaw
 * counter-clockwise. All numbers little-endian, no padding. Which place of a frame's command and
 * channels means what: the file `channels` of the running graph, or `vigil channels`. */
#ifndef VIGIL_TYPES_H
#define VIGIL_TYPES_H

#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "blocks and datagrams are little-endian"
#endif

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#ifdef __cplusplus
#define VIGIL_ASSERT(condition) static_assert(condition, #condition)
#else
#define VIGIL_ASSERT(condition) _Static_assert(condition, #condition)
#endif

"#;

/// The datagrams, see `vigil_blocks::datagram`.
const TAIL: &str = r#"
/* CRC-32C (Castagnoli), bit by bit: `crc` is what came before, 0 to begin. */
static inline uint32_t vigil_crc32c(uint32_t crc, const uint8_t *bytes, size_t count) {
  crc = ~crc;
  for (size_t i = 0; i < count; i++) {
    crc ^= bytes[i];
    for (int bit = 0; bit < 8; bit++) crc = (crc >> 1) ^ (0x82f63b78u & (0u - (crc & 1u)));
  }
  return ~crc;
}

/* What a datagram begins with: `kind` 1 is a frame, 2 a verdict. */
static inline void vigil_datagram_head(uint8_t kind, size_t size, uint8_t head[12]) {
  const uint8_t bytes[12] = {'V', 'G', 'I', 'L', 2, 0, kind, 0,
                             (uint8_t)(size & 0xff), (uint8_t)(size >> 8), 0, 0};
  memcpy(head, bytes, 12);
}

/* Checksum of a datagram, which holds a block of this size. */
static inline uint32_t vigil_datagram_crc(const uint8_t *bytes, size_t size) {
  return vigil_crc32c(vigil_crc32c(0, bytes, 12), bytes + 16, size);
}

/* The datagram of a frame, for the sockets of `sensor.source = "socket"`. The sender fills in
 * header.epoch (not 0, another at each start), header.seq and header.t_capture_ns; it leaves
 * header.t_schedule_ns at 0 unless it runs on Vigil's machine and has its CLOCK_MONOTONIC. */
static inline void vigil_datagram(const vigil_sensor_frame *frame,
                                  uint8_t bytes[VIGIL_DATAGRAM_SIZE]) {
  vigil_datagram_head(1, sizeof *frame, bytes);
  memcpy(bytes + 16, frame, sizeof *frame);
  const uint64_t schema = VIGIL_SENSOR_FRAME_SCHEMA;
  memcpy(bytes + 16, &schema, 8);
  const uint32_t crc = vigil_datagram_crc(bytes, sizeof *frame);
  for (int i = 0; i < 4; i++) bytes[12 + i] = (uint8_t)(crc >> (8 * i));
}

/* Takes the verdict of a datagram that came back; 0 if it is none. Obey it for
 * verdict->valid_for_ns from now, and stop after that. */
static inline int vigil_take_verdict(const uint8_t *bytes, size_t count, vigil_verdict *verdict) {
  uint8_t head[12];
  vigil_datagram_head(2, sizeof *verdict, head);
  if (count != VIGIL_VERDICT_DATAGRAM_SIZE || memcmp(bytes, head, 12) != 0) return 0;
  const uint32_t crc = vigil_datagram_crc(bytes, sizeof *verdict);
  for (int i = 0; i < 4; i++)
    if (bytes[12 + i] != (uint8_t)(crc >> (8 * i))) return 0;
  uint64_t schema = 0;
  memcpy(&schema, bytes + 16, 8);
  if (schema != VIGIL_VERDICT_SCHEMA) return 0;
  memcpy(verdict, bytes + 16, sizeof *verdict);
  return 1;
}

#endif
"#;

/// The whole header.
pub fn header() -> String {
    let mut text = String::from(HEAD);
    for (prefix, name, value) in constants() {
        let _ = writeln!(text, "#define VIGIL_{prefix}_{name} {value}u");
    }
    let _ = writeln!(text, "#define VIGIL_DATAGRAM_SIZE {DATAGRAM_SIZE}u");
    let size = VERDICT_DATAGRAM_SIZE;
    let _ = writeln!(text, "#define VIGIL_VERDICT_DATAGRAM_SIZE {size}u\n");
    for item in structs() {
        one(&item, &mut text);
    }
    text.push_str(TAIL);
    text
}

fn one(item: &Struct, text: &mut String) {
    let name = snake(item.name);
    if let Some((schema, type_name)) = item.block {
        let upper = name.to_uppercase();
        let _ = writeln!(text, "#define VIGIL_{upper}_SCHEMA 0x{schema:016x}ull");
        let _ = writeln!(text, "#define VIGIL_{upper}_TYPE_NAME \"{type_name}\"");
    }
    let _ = writeln!(text, "typedef struct {{");
    for field in item.fields {
        let (element, count) = elements(field);
        let c_type = if is_text(field) {
            "char".into()
        } else {
            c_type(element)
        };
        let count = count.map_or_else(String::new, |n| format!("[{n}]"));
        let _ = writeln!(text, "  /* {} */", doc(field));
        let _ = writeln!(text, "  {c_type} {}{count};", field.name);
    }
    let _ = writeln!(text, "}} vigil_{name};");
    let _ = writeln!(text, "VIGIL_ASSERT(sizeof(vigil_{name}) == {});", item.size);
    for field in item.fields {
        let (field, offset) = (field.name, field.offset);
        let _ = writeln!(
            text,
            "VIGIL_ASSERT(offsetof(vigil_{name}, {field}) == {offset});"
        );
    }
    text.push('\n');
}

fn c_type(rust: &str) -> String {
    match rust {
        "f64" => "double".into(),
        "f32" => "float".into(),
        "u64" | "u32" | "u16" | "u8" => format!("uint{}_t", &rust[1..]),
        "i64" | "i32" | "i16" | "i8" => format!("int{}_t", &rust[1..]),
        name => format!("vigil_{}", snake(name)),
    }
}

/// `SensorFrame` as `sensor_frame`.
fn snake(name: &str) -> String {
    let mut text = String::new();
    for c in name.chars() {
        if c.is_ascii_uppercase() && !text.is_empty() {
            text.push('_');
        }
        text.push(c.to_ascii_lowercase());
    }
    text
}
