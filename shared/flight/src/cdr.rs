//! Values in CDR, the form in which messages of ROS 2 travel: version 1, little endian.

/// Encapsulation: plain CDR, little endian, no options. Alignment counts from after it.
const HEAD: [u8; 4] = [0, 1, 0, 0];

/// A message in CDR, as far as it is written.
#[derive(Debug, Clone)]
pub(crate) struct Cdr {
    bytes: Vec<u8>,
}

impl Cdr {
    /// An empty message.
    pub(crate) fn new() -> Self {
        Self {
            bytes: HEAD.to_vec(),
        }
    }

    /// Forgets what was written; the memory is kept.
    pub(crate) fn clear(&mut self) {
        self.bytes.truncate(HEAD.len());
    }

    /// The message, its encapsulation first.
    pub(crate) fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// A value lies at a multiple of its own size.
    fn put(&mut self, value: &[u8]) {
        let written = self.bytes.len() - HEAD.len();
        let padded = HEAD.len() + written.next_multiple_of(value.len());
        self.bytes.resize(padded, 0);
        self.bytes.extend_from_slice(value);
    }

    /// A byte.
    pub(crate) fn u8(&mut self, value: u8) {
        self.put(&[value]);
    }

    /// A signed number of 32 bits.
    pub(crate) fn i32(&mut self, value: i32) {
        self.put(&value.to_le_bytes());
    }

    /// An unsigned number of 32 bits.
    pub(crate) fn u32(&mut self, value: u32) {
        self.put(&value.to_le_bytes());
    }

    /// A number of double precision.
    pub(crate) fn f64(&mut self, value: f64) {
        self.put(&value.to_le_bytes());
    }

    /// Numbers whose count the type gives.
    pub(crate) fn f64_array(&mut self, values: &[f64]) {
        for value in values {
            self.f64(*value);
        }
    }

    /// Numbers of any count.
    pub(crate) fn f64_sequence(&mut self, values: &[f64]) {
        self.count(values.len());
        self.f64_array(values);
    }

    /// How many elements of a sequence follow. No message has more than 32 bits can count.
    pub(crate) fn count(&mut self, count: usize) {
        self.u32(count as u32);
    }

    /// Text: its length with the zero that ends it, its bytes, the zero. A zero within would end
    /// it early for some readers and is left out.
    pub(crate) fn text(&mut self, text: &str) {
        let held = || text.bytes().filter(|byte| *byte != 0);
        self.count(held().count() + 1);
        self.bytes.extend(held());
        self.bytes.push(0);
    }

    /// Texts of any count.
    pub(crate) fn text_sequence(&mut self, texts: &[String]) {
        self.count(texts.len());
        for text in texts {
            self.text(text);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_aligned_from_after_the_encapsulation() {
        let mut cdr = Cdr::new();
        cdr.u8(7);
        cdr.u32(0x0403_0201);
        cdr.f64(1.5);
        cdr.u8(9);
        cdr.i32(-2);
        #[rustfmt::skip]
        let expected = [
            0, 1, 0, 0,
            7, 0, 0, 0, 1, 2, 3, 4,
            0, 0, 0, 0, 0, 0, 0xf8, 0x3f,
            9, 0, 0, 0, 0xfe, 0xff, 0xff, 0xff,
        ];
        assert_eq!(cdr.bytes(), expected);
    }

    #[test]
    fn a_number_of_8_bytes_after_one_of_4_is_padded() {
        let mut cdr = Cdr::new();
        cdr.u32(1);
        cdr.f64(-2.0);
        #[rustfmt::skip]
        let expected = [
            0, 1, 0, 0,
            1, 0, 0, 0, 0, 0, 0, 0,
            0, 0, 0, 0, 0, 0, 0, 0xc0,
        ];
        assert_eq!(cdr.bytes(), expected);
    }

    #[test]
    fn texts_have_their_length_and_end_with_zero() {
        let mut cdr = Cdr::new();
        cdr.text_sequence(&["ab".to_owned(), String::new()]);
        cdr.text("µ");
        #[rustfmt::skip]
        let expected = [
            0, 1, 0, 0,
            2, 0, 0, 0,
            3, 0, 0, 0, b'a', b'b', 0, 0,
            1, 0, 0, 0, 0, 0, 0, 0,
            3, 0, 0, 0, 0xc2, 0xb5, 0,
        ];
        assert_eq!(cdr.bytes(), expected);
        cdr.clear();
        cdr.text("a\0b");
        assert_eq!(cdr.bytes(), [0, 1, 0, 0, 3, 0, 0, 0, b'a', b'b', 0]);
    }

    #[test]
    fn an_empty_sequence_is_its_count_alone() {
        let mut cdr = Cdr::new();
        cdr.f64_sequence(&[]);
        cdr.u8(1);
        assert_eq!(cdr.bytes(), [0, 1, 0, 0, 0, 0, 0, 0, 1]);
    }
}
