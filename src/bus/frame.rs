//! Frames as bytes: checks, lengths, shapes.

/// CRC-16 of Modbus RTU (polynomial 0xA001 reflected, start 0xFFFF); sent low byte first.
pub fn crc16(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0xFFFF, |crc, byte| {
        (0..8).fold(crc ^ u16::from(*byte), |crc, _| if crc & 1 == 1 { (crc >> 1) ^ 0xA001 } else { crc >> 1 })
    })
}

/// Appends the CRC to unit and PDU.
pub fn with_crc(message: &[u8]) -> Vec<u8> {
    let mut frame = message.to_vec();
    frame.extend_from_slice(&crc16(message).to_le_bytes());
    frame
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_check_value_of_the_standard() {
        assert_eq!(crc16(b"123456789"), 0x4B37);
        assert_eq!(with_crc(&[0x01, 0x06, 0x03, 0xEA, 0x00, 0x32]), [0x01, 0x06, 0x03, 0xEA, 0x00, 0x32, 0x29, 0xAF]);
    }
}
