//! Modbus ASCII: `:`, two hexadecimal digits a byte, LRC, CR LF (Modbus over serial line V1.02, 2.5.2).

use crate::plant::event::Fault;

/// Longest frame, in characters.
pub const FRAME_MAX: usize = 513;

/// Longitudinal redundancy check: two's complement of the sum of all bytes.
pub fn lrc(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0u8, |sum, byte| sum.wrapping_add(*byte)).wrapping_neg()
}

/// The frame of a message.
pub fn encode(message: &[u8]) -> Vec<u8> {
    let check = lrc(message);
    let digits = message.iter().chain([&check]).map(|byte| format!("{byte:02X}"));
    format!(":{}\r\n", digits.collect::<String>()).into_bytes()
}

/// The message of a frame from `:` to LF, if its LRC fits. Small letters are taken, as some devices send them.
pub fn decode(frame: &[u8]) -> Result<Vec<u8>, Fault> {
    let inner = frame.strip_prefix(b":").unwrap_or(frame);
    let inner = inner.strip_suffix(b"\n").unwrap_or(inner);
    let digits = inner.strip_suffix(b"\r").unwrap_or(inner);
    let mut bytes = Vec::with_capacity(digits.len() / 2);
    let digit = |char: u8| char::from(char).to_digit(16).map(|digit| digit as u8).ok_or(Fault::NotHex(char));
    let (pairs, rest) = digits.as_chunks::<2>();
    for [high, low] in pairs {
        bytes.push(digit(*high)? << 4 | digit(*low)?);
    }
    let too_short = Fault::Truncated { got: frame.len() as u16, expected: (frame.len() + 1).max(9) as u16 };
    if !rest.is_empty() || bytes.len() < 3 {
        return Err(too_short);
    }
    let Some((got, message)) = bytes.split_last() else { return Err(too_short) };
    let computed = lrc(message);
    if *got == computed { Ok(message.to_vec()) } else { Err(Fault::Lrc { got: *got, computed }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_is_told_apart_from_a_spoiled_one() {
        let frame = encode(&[0x01, 0x03, 0x03, 0xEA, 0x00, 0x01]);
        assert_eq!(frame, b":010303EA00010E\r\n");
        assert_eq!(decode(&frame), Ok(vec![0x01, 0x03, 0x03, 0xEA, 0x00, 0x01]));
        assert_eq!(decode(b":010303ea00010e\r\n"), decode(&frame));
        assert_eq!(decode(b":010303EA00020E\r\n"), Err(Fault::Lrc { got: 0x0E, computed: 0x0D }));
        assert_eq!(decode(b":01030#EA00010E\r\n"), Err(Fault::NotHex(b'#')));
        for cut in 0..frame.len() - 2 {
            assert!(decode(&frame[..cut]).is_err(), "cut at {cut}");
        }
    }
}
