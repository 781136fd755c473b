//! Kitty graphics: a PNG in pieces of Base64, under one number, so that the next picture takes the place of the last.

use base64::{Engine, engine::general_purpose::STANDARD};

/// Most letters of a piece, as the protocol has it.
const PIECE_MAX: usize = 4_096;
/// Asks whether it can: shows nothing; the answer is `ESC _ G i=31 ; OK ESC \`.
pub const QUESTION: &[u8] = b"\x1b_Gi=31,s=1,v=1,a=q,t=d,f=24;AAAA\x1b\\";
/// Takes the picture away and forgets it.
pub const DELETE: &[u8] = b"\x1b_Ga=d,d=I,i=31,q=2\x1b\\";

/// Shows a PNG at the cursor, which stays, over so many columns and rows. No answer is wanted: it would arrive among the keys.
pub fn show(png: &[u8], (columns, rows): (u16, u16)) -> Vec<u8> {
    let text = STANDARD.encode(png);
    let pieces: Vec<&[u8]> = text.as_bytes().chunks(PIECE_MAX).collect();
    let mut sent = Vec::with_capacity(text.len() + 24 * pieces.len() + 64);
    for (n, piece) in pieces.iter().enumerate() {
        sent.extend(b"\x1b_G");
        if n == 0 {
            sent.extend(format!("a=T,f=100,t=d,i=31,p=1,C=1,c={columns},r={rows},").into_bytes());
        }
        sent.extend(format!("q=2,m={};", u8::from(n + 1 < pieces.len())).into_bytes());
        sent.extend(*piece);
        sent.extend(b"\x1b\\");
    }
    sent
}

/// The PNG in what [`show`] has made.
#[cfg(test)]
pub(crate) fn png_of(sent: &[u8]) -> Vec<u8> {
    let text = std::str::from_utf8(sent).expect("letters");
    let (mut coded, mut goes_on) = (String::new(), true);
    for piece in text.split_terminator("\x1b\\") {
        assert!(goes_on, "nothing follows the last piece");
        let (keys, letters) = piece.split_once("\x1b_G").and_then(|(_, rest)| rest.split_once(';')).expect("a piece");
        assert!(letters.len() <= PIECE_MAX && keys.contains("q=2"), "{keys}");
        goes_on = keys.contains("m=1");
        coded.push_str(letters);
    }
    assert!(!goes_on, "the last piece says so");
    STANDARD.decode(coded).expect("Base64")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pieces_are_the_png_again() {
        for length in [0, 1, 3_071, 3_072, 3_073, 10_000] {
            let png: Vec<u8> = (0..length).map(|n| (n * 7 % 251) as u8).collect();
            let sent = if png.is_empty() { continue } else { show(&png, (60, 12)) };
            assert_eq!(png_of(&sent), png, "{length}");
            assert_eq!(sent.windows(2).filter(|two| two == b"c=").count(), 1, "the size stands once");
        }
    }
}
