//! The pattern test: bytes that a loopback plug gives back as they were sent, and what became of them.

use crate::plant::{
    diagnostics::{DiagnosticRun, Finding, PatternTally},
    number::to_u8,
};

/// Bytes of one pattern.
const LENGTH: u8 = 32;

/// Pattern `n`, in characters of `bits` data bits: what cables and drivers find hard, in turn. None is a frame.
pub(super) fn bytes(n: u32, bits: u8) -> Vec<u8> {
    let mask = if bits == 7 { 0x7F } else { 0xFF };
    let round = to_u8(n / 6 % 256);
    let mut random = u32::from(round) << 8 | 0xACE1;
    let byte = |at: u8| match n % 6 {
        0 => 0x55,
        1 => 0xAA,
        2 => 0x00,
        3 => 0xFF,
        4 => at.wrapping_add(round.wrapping_mul(LENGTH)),
        _ => {
            // Galois register of 16 bits, a byte at a time.
            (0..8).for_each(|_| random = random >> 1 ^ if random & 1 == 1 { 0xB400 } else { 0 });
            to_u8(random & 0xFF)
        }
    };
    (0..LENGTH).map(byte).map(|byte| byte & mask).collect()
}

/// What became of pattern `n`: the fewest faults that explain what was received.
pub fn tally(n: u32, bits: u8, received: &[u8]) -> PatternTally {
    let sent = bytes(n, bits);
    let after = |tally: PatternTally, wrong, missing, extra| PatternTally {
        wrong: tally.wrong + wrong,
        missing: tally.missing + missing,
        extra: tally.extra + extra,
        ..tally
    };
    // Of the first bytes sent, against ever more of those received (Wagner and Fischer 1974).
    let start = PatternTally { sent: sent.len(), received: received.len(), ..PatternTally::default() };
    let mut row: Vec<PatternTally> = (0..=received.len()).map(|extra| PatternTally { extra, ..start }).collect();
    for byte in &sent {
        let mut next = vec![after(row[0], 0, 1, 0)];
        for (at, got) in received.iter().enumerate() {
            let same = after(row[at], usize::from(byte != got), 0, 0);
            let others = [after(row[at + 1], 0, 1, 0), after(next[at], 0, 0, 1)];
            next.push(others.into_iter().fold(same, |best, one| if one.faults() < best.faults() { one } else { best }));
        }
        row = next;
    }
    row[received.len()]
}

/// All patterns of a test so far.
pub fn tally_of(run: &DiagnosticRun, bits: u8) -> PatternTally {
    let received = run.findings.iter().filter_map(|finding| match finding {
        Finding::Bytes { bytes, .. } => Some(bytes),
        Finding::Exchange(_)
        | Finding::Unit { .. }
        | Finding::Object { .. }
        | Finding::Values { .. }
        | Finding::Written(_)
        | Finding::Swept(_)
        | Finding::Signals { .. }
        | Finding::Failed { .. }
        | Finding::Conclusion(_) => None,
    });
    (0..).zip(received).map(|(n, bytes)| tally(n, bits, bytes)).fold(PatternTally::default(), |sum, one| PatternTally {
        sent: sum.sent + one.sent,
        received: sum.received + one.received,
        wrong: sum.wrong + one.wrong,
        missing: sum.missing + one.missing,
        extra: sum.extra + one.extra,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{bus::frame, plant::line::Framing};

    #[test]
    fn no_pattern_is_a_frame_and_seven_bits_stay_seven() {
        for n in 0..3_000 {
            let pattern = bytes(n, 8);
            assert!(pattern.len() == 32 && frame::unwrap(Framing::Rtu, &pattern).is_err(), "{n}");
            assert!(frame::unwrap(Framing::Ascii, &pattern).is_err(), "{n}");
            assert!(bytes(n, 7).iter().all(|byte| *byte < 0x80), "{n}");
        }
        assert_ne!(bytes(5, 8), bytes(11, 8));
    }

    #[test]
    fn what_came_back_is_compared_byte_by_byte() {
        let check = |change: &dyn Fn(&mut Vec<u8>), expect: [usize; 4]| {
            let mut received = bytes(4, 8);
            change(&mut received);
            let tally = tally(4, 8, &received);
            assert_eq!([tally.received, tally.wrong, tally.missing, tally.extra], expect, "{received:02X?}");
        };
        check(&|_| {}, [32, 0, 0, 0]);
        check(&Vec::clear, [0, 0, 32, 0]);
        check(&|bytes| bytes[7] ^= 0x80, [32, 1, 0, 0]);
        check(&|bytes| bytes.truncate(31), [31, 0, 1, 0]);
        check(&|bytes| bytes.insert(7, 0xFF), [33, 0, 0, 1]);
        check(&|bytes| drop(bytes.drain(..3)), [29, 0, 3, 0]);
    }
}
