//! Values in CDR, the encoding of ROS 2 (OMG DDSI-RTPS 2.3, section 10; plain CDR, version 1):
//! numbers lie at multiples of their size, counted from after the four bytes of encapsulation.

use super::schema::Kind;

/// What a message that ends too soon is told as.
const SHORT: &str = "the message is too short for its type";

/// A place in a message. A copy reads on from the same place.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cdr<'a> {
    body: &'a [u8],
    at: usize,
    is_big: bool,
}

impl<'a> Cdr<'a> {
    /// The beginning of a message with its encapsulation, of either byte order.
    pub fn new(data: &'a [u8]) -> Result<Self, String> {
        let (head, body) = data.split_at_checked(4).ok_or(SHORT)?;
        let is_big = match head {
            [0, 0, ..] => true,
            [0, 1, ..] => false,
            _ => return Err("not in plain CDR".into()),
        };
        Ok(Self {
            body,
            at: 0,
            is_big,
        })
    }

    fn left(&self) -> usize {
        self.body.len().saturating_sub(self.at)
    }

    fn take(&mut self, count: usize) -> Result<&'a [u8], String> {
        let end = self.at.checked_add(count).ok_or(SHORT)?;
        let bytes = self.body.get(self.at..end).ok_or(SHORT)?;
        self.at = end;
        Ok(bytes)
    }

    const fn align(&mut self, size: usize) {
        self.at = self.at.next_multiple_of(size);
    }

    /// Passes over `count` numbers of `size` bytes.
    pub fn skip(&mut self, count: usize, size: usize) -> Result<(), String> {
        if count > 0 {
            self.align(size);
            self.take(count.checked_mul(size).ok_or(SHORT)?)?;
        }
        Ok(())
    }

    /// A number.
    pub fn number(&mut self, kind: Kind) -> Result<f64, String> {
        let size = kind.size().ok_or("no number")?;
        self.align(size);
        let bytes = self.take(size)?;
        let fold = |all: u64, byte: &u8| all << 8 | u64::from(*byte);
        let bits = match self.is_big {
            true => bytes.iter().fold(0, fold),
            false => bytes.iter().rev().fold(0, fold),
        };
        // Bits above a short number, by which its sign is extended.
        let above = 64 - 8 * size as u32;
        Ok(match kind {
            Kind::Float(4) => f64::from(f32::from_bits(bits as u32)),
            Kind::Float(_) => f64::from_bits(bits),
            Kind::Signed(_) => ((bits << above) as i64 >> above) as f64,
            _ => bits as f64,
        })
    }

    /// Length of a sequence, whose elements take a byte at least.
    pub fn length(&mut self) -> Result<usize, String> {
        let length = self.number(Kind::Unsigned(4))? as usize;
        self.fits(length)?;
        Ok(length)
    }

    /// Refuses more elements than there are bytes left.
    pub fn fits(&self, elements: usize) -> Result<(), String> {
        match elements <= self.left() {
            true => Ok(()),
            false => Err(SHORT.into()),
        }
    }

    /// A string without its final zero.
    pub fn text(&mut self) -> Result<&'a str, String> {
        let length = self.length()?;
        let bytes = self.take(length)?;
        let bytes = bytes.strip_suffix(&[0]).unwrap_or(bytes);
        std::str::from_utf8(bytes).map_err(|_| "a string is not in UTF-8".into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_all_kinds_and_both_orders_are_read() {
        // By hand: -2 as int16, then 1.5 as float32 at 4, then 0xff at 8, -1.0 as float64 at 16.
        let little = [
            0, 1, 0, 0, 0xfe, 0xff, 0, 0, 0, 0, 0xc0, 0x3f, 0xff, 0, 0, 0, 0, 0, 0, 0, //
            0, 0, 0, 0, 0, 0, 0xf0, 0xbf,
        ];
        let big = [
            0, 0, 0, 0, 0xff, 0xfe, 0, 0, 0x3f, 0xc0, 0, 0, 0xff, 0, 0, 0, 0, 0, 0, 0, //
            0xbf, 0xf0, 0, 0, 0, 0, 0, 0,
        ];
        for data in [little, big] {
            let mut cdr = Cdr::new(&data).unwrap();
            assert_eq!(cdr.number(Kind::Signed(2)).unwrap(), -2.0);
            assert_eq!(cdr.number(Kind::Float(4)).unwrap(), 1.5);
            assert_eq!(cdr.number(Kind::Unsigned(1)).unwrap(), 255.0);
            assert_eq!(cdr.number(Kind::Float(8)).unwrap(), -1.0);
            assert!(cdr.number(Kind::Bool).is_err());
        }
        assert!(Cdr::new(&[0, 7, 0, 0]).is_err());
        assert!(Cdr::new(&[0, 1, 0]).is_err());
        // A length of 4 billion in a message of some bytes.
        let mut cdr = Cdr::new(&[0, 1, 0, 0, 0xff, 0xff, 0xff, 0xff, 1, 2]).unwrap();
        assert!(cdr.text().is_err());
    }
}
