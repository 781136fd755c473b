//! Passwords: which are good enough, and the Argon2id hash that is kept of them.

use std::{
    collections::BTreeSet,
    sync::{Mutex, PoisonError},
};

use argon2::{
    Algorithm, Argon2, Block, Params, Version,
    password_hash::{
        PasswordHasher,
        phc::{Output, PasswordHash},
    },
};
use unicode_normalization::UnicodeNormalization;

use crate::plant::request_refusal::RequestRefusal;

/// Most characters of a password: enough for a passphrase, too few to load the station.
pub const CHARS_MAX: usize = 128;
/// Letters and digits that must be left of a password without names and repetitions: more than the least password of NIST SP
/// 800-63B has, so that a name does not do the work of a word.
const OWN_CHARS_MIN: usize = 10;
/// Shorter names are in too many words.
const NAME_CHARS_MIN: usize = 3;
/// Bytes of a salt.
pub const SALT_BYTES: usize = 16;
/// 19 MiB, twice, one lane: what OWASP recommends for Argon2id.
const COST: (u32, u32, u32) = (19 * 1024, 2, 1);
/// Most costly hash accepted from a file, so that it cannot stall the station: KiB and rounds.
const COST_MAX: (u32, u32) = (64 * 1024, 10);
/// Common passwords. Compared without case and punctuation, and as a repetition.
const COMMON: [&str; 16] = [
    "password",
    "passphrase",
    "passwort",
    "letmein",
    "welcome",
    "sightglass",
    "operator",
    "supervisor",
    "technician",
    "administrator",
    "admin",
    "changeme",
    "qwerty",
    "qwertyuiop",
    "1234567890",
    "abcdefghijklmnopqrstuvwxyz",
];
/// The hash of an unknown text: an unknown name costs the same work as a known one.
pub const DUMMY: &str = "$argon2id$v=19$m=19456,t=2,p=1$c2lnaHRnbGFzc25vYm9keQ$\
     AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA";

/// The one form of a text: the same letters may be typed in several ways (a letter with an accent, or the letter and then
/// the accent; a Thai tone before or after a vowel), depending on the keyboard. NFC joins these and nothing else: other
/// forms would make different letters equal.
pub fn one_form(text: &str) -> String {
    text.nfc().collect()
}

/// Checks a new password of a user. `names`: of the user and of the plant, which are the first that an attacker tries, and so
/// are repetitions (NIST SP 800-63B, 5.1.1.2). `Err` says what is expected.
pub fn check(password: &str, names: &[&str], chars_min: u16) -> Result<(), RequestRefusal> {
    let password = one_form(password);
    let chars = password.chars().count();
    if chars < usize::from(chars_min) {
        return Err(RequestRefusal::PasswordShort { chars, least: chars_min });
    }
    if CHARS_MAX < chars {
        return Err(RequestRefusal::PasswordLong { chars, most: CHARS_MAX });
    }
    if password.chars().any(char::is_control) {
        return Err(RequestRefusal::PasswordUntypable);
    }
    let is_common = |plain: &str| COMMON.iter().any(|common| made_of(plain, common));
    let (whole, unnamed) = (plain(&password), without(&password.to_lowercase(), names));
    if is_common(&whole) || is_common(&plain(&unnamed)) {
        return Err(RequestRefusal::PasswordCommon);
    }
    if own_chars(&password) < OWN_CHARS_MIN {
        return Err(RequestRefusal::PasswordRepeats);
    }
    if own_chars(&unnamed) < OWN_CHARS_MIN {
        return Err(RequestRefusal::PasswordIsName);
    }
    Ok(())
}

/// A text in small letters with a gap in place of each name and each word of a name, however it is spaced.
fn without(text: &str, names: &[&str]) -> String {
    let letters: Vec<(usize, char)> = text.char_indices().filter(|(_, letter)| is_said(*letter)).collect();
    let mut left: Vec<char> = text.chars().collect();
    let places: Vec<usize> = text.char_indices().map(|(at, _)| at).collect();
    let words = names.iter().flat_map(|name| name.split(|letter| !is_said(letter)).chain([*name]));
    for word in words.map(plain).filter(|word| NAME_CHARS_MIN <= word.chars().count()) {
        let word: Vec<char> = word.chars().collect();
        for found in letters.windows(word.len()).filter(|part| part.iter().map(|(_, letter)| letter).eq(&word)) {
            for (at, _) in found {
                if let Ok(place) = places.binary_search(at) {
                    left[place] = ' ';
                }
            }
        }
    }
    left.into_iter().collect()
}

/// Letters and digits of a text that tell anything: each word and each number once, a letter that is held down once, and of
/// what is the same again and again only the first.
fn own_chars(text: &str) -> usize {
    let text = text.to_lowercase();
    let kind = |letter: char| (is_said(letter), letter.is_numeric());
    let letters: Vec<char> = text.chars().collect();
    let words: BTreeSet<&[char]> = letters.chunk_by(|one, other| kind(*one) == kind(*other)).collect();
    let changes = |word: &[char]| 1 + word.windows(2).filter(|pair| pair[0] != pair[1]).count();
    let once = words.iter().filter(|word| is_said(word[0])).map(|word| changes(word)).sum();
    let said: Vec<char> = letters.into_iter().filter(|letter| is_said(*letter)).collect();
    let again = (1..=said.len() / 2).find(|period| said[*period..] == said[..said.len() - period]);
    again.unwrap_or(said.len()).min(once)
}

/// Is it this word, once or several times, cut anywhere, with at most two more characters?
fn made_of(plain: &str, word: &str) -> bool {
    let mut rest = plain;
    let mut times = 0;
    while let Some(after) = rest.strip_prefix(word) {
        rest = after;
        times += 1;
    }
    times > 0 && (rest.chars().count() <= 2 || word.starts_with(rest) || rest.chars().all(|c| c.is_ascii_digit()))
}

/// Without case, and without what is no letter, mark or digit of any script.
fn plain(text: &str) -> String {
    one_form(text).chars().filter(|letter| is_said(*letter)).collect::<String>().to_lowercase()
}

/// Is it a letter, mark or digit of any script?
fn is_said(letter: char) -> bool {
    !letter.is_whitespace() && !letter.is_ascii_punctuation()
}

/// Hashes a password, about 20 ms of work. `Err` only where memory is short.
pub fn hash(password: &str, salt: [u8; SALT_BYTES]) -> Result<String, String> {
    let hashed: Result<PasswordHash, _> = argon2().hash_password_with_salt(one_form(password).as_bytes(), &salt);
    hashed.map(|hash| hash.to_string()).map_err(|error| format!("the password could not be hashed: {error}"))
}

/// Is it the password of this hash? The same work for every hash of ours, right or wrong.
pub fn is(password: &str, hash: &str) -> bool {
    let Ok(hash) = PasswordHash::new(hash) else { return false };
    // Never more work than for the longest that can be.
    let password: String = one_form(password).chars().take(CHARS_MAX + 1).collect();
    recomputed(&hash, password.as_bytes()).is_some_and(|output| hash.hash == Some(output))
}

/// The output that this password has with the salt and the cost of a hash. Outputs are compared in constant time.
fn recomputed(hash: &PasswordHash, password: &[u8]) -> Option<Output> {
    let params = Params::try_from(hash).ok()?;
    let (algorithm, version) =
        (Algorithm::try_from(hash.algorithm.as_str()).ok()?, Version::try_from(hash.version?).ok()?);
    let (blocks, salt) = (params.block_count(), hash.salt.as_ref()?);
    let mut output = vec![0; hash.hash.as_ref()?.len()];
    let work = Argon2::new(algorithm, version, params);
    let done =
        with_memory(blocks, |memory| work.hash_password_into_with_memory(password, salt.as_ref(), &mut output, memory));
    done.ok()?;
    Output::new(&output).ok()
}

/// The memory of a hash is taken again for the next one. Given back each time, it would stay in the heap of every thread
/// that has ever hashed: measured, 120 MB after a dozen logins. There are as many as there are hashes at once, which is two.
fn with_memory<T>(blocks: usize, work: impl FnOnce(&mut [Block]) -> T) -> T {
    static FREE: Mutex<Vec<Vec<Block>>> = Mutex::new(Vec::new());
    let free = || FREE.lock().unwrap_or_else(PoisonError::into_inner);
    let mut memory = free().pop().unwrap_or_default();
    if memory.len() < blocks {
        memory.resize(blocks, Block::default());
    }
    let done = work(&mut memory);
    free().push(memory);
    done
}

/// Is this a hash that [`is`] can compare with, at a cost that can be borne?
pub fn check_hash(text: &str) -> Result<(), &'static str> {
    let expected = "expected an Argon2id hash, as the station writes it";
    let hash = PasswordHash::new(text).map_err(|_| expected)?;
    let params = Params::try_from(&hash).map_err(|_| expected)?;
    let complete = hash.algorithm.as_str() == "argon2id" && hash.salt.is_some() && hash.hash.is_some();
    if !complete || COST_MAX.0 < params.m_cost() || COST_MAX.1 < params.t_cost() || 4 < params.p_cost() {
        return Err(expected);
    }
    Ok(())
}

fn argon2() -> Argon2<'static> {
    let (memory, times, lanes) = COST;
    let params = Params::new(memory, times, lanes, None).expect("these numbers are within the limits of Argon2");
    Argon2::new(Algorithm::Argon2id, Version::V0x13, params)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    const NAMES: &[&str] = &["anna", "tank"];

    #[test]
    fn any_language_is_accepted_and_common_passwords_are_not() {
        let good =
            ["four wet horses in a tank", "ปั๊มน้ำเสียทุกวันจันทร์", "grüße aus dem kesselhaus", "passwordless entry is fine"];
        for password in good {
            assert_eq!(check(password, NAMES, 15), Ok(()), "{password}");
        }
        let bad = [
            "short",
            "anna anna anna anna",
            "Password Password 1",
            "password123456789",
            "aaaaaaaaaaaaaaaaaaa",
            "1212121212121212",
            "12345678901234567890",
            "qwertyuiopqwertyuiop",
            "                    ",
            "with a bell \u{7} in the middle",
        ];
        for password in bad {
            assert!(check(password, NAMES, 15).is_err(), "{password}");
        }
        assert!(check(&"wet horses ".repeat(12), NAMES, 15).is_err(), "too long");
    }

    #[test]
    fn names_and_repetitions_do_no_work_in_a_password() {
        let repeats = [
            "boss boss boss boss",
            "BossBossBossBossBoss",
            "boss1boss2boss3boss4",
            "horse, horse, horse, horse",
            "wet horse wet horse wet",
            "wethorsewethorsewethorse",
            "11112222333344445555 11112222",
            "ม้าเปียก ม้าเปียก ม้าเปียก",
            "a b c d a b c d a b c d",
        ];
        let named = ["anna at the tank", "t.a.n.k.a.n.n.a 1234567", "ANNA kessel anna 12", "north works anna 99!!"];
        for (passwords, why) in
            [(&repeats[..], RequestRefusal::PasswordRepeats), (&named[..], RequestRefusal::PasswordIsName)]
        {
            for password in passwords {
                let refused = check(password, &["anna", "tank", "Kessel North Works"], 15).expect_err(password);
                assert_eq!(refused, why, "{password}");
            }
        }
        assert_eq!(check("anna password tank password", NAMES, 15), Err(RequestRefusal::PasswordCommon));
        assert_eq!(check("anna wet horses 1", NAMES, 15), Ok(()), "ten letters and digits beside the name");
        assert_eq!(check("anna wet horse 1", NAMES, 15), Err(RequestRefusal::PasswordIsName), "nine");
        for good in [
            "anna is on a wet horse",
            "the wet horse and the dry horse",
            "boss second pass word",
            "al is at the pumps al",
        ] {
            assert_eq!(check(good, &["anna", "tank", "al", ""], 15), Ok(()), "{good}");
        }
    }

    #[test]
    fn a_password_typed_on_another_keyboard_is_the_same() {
        let hash = hash("caf\u{e9} im kesselhaus", [7; SALT_BYTES]).unwrap();
        assert_eq!(check_hash(&hash), Ok(()));
        assert!(is("cafe\u{301} im kesselhaus", &hash));
        assert!(!is("cafe im kesselhaus", &hash));
        assert!(!is("", &hash) && !is("caf\u{e9} im kesselhaus ", &hash));
        assert!(hash.starts_with("$argon2id$v=19$m=19456,t=2,p=1$"), "{hash}");
    }

    #[test]
    fn the_longest_password_counts_up_to_its_last_letter() {
        let longest = "x".repeat(CHARS_MAX);
        let hash = hash(&longest, [7; SALT_BYTES]).unwrap();
        assert!(is(&longest, &hash));
        assert!(!is(&format!("{longest}x"), &hash), "a longer one is another one");
    }

    #[test]
    fn a_hash_that_would_stall_the_station_is_not_taken() {
        assert_eq!(check_hash(DUMMY), Ok(()), "an unknown name costs the same work");
        assert!(check_hash(&DUMMY.replace("m=19456", "m=4000000")).is_err());
        assert!(check_hash(&DUMMY.replace("argon2id", "argon2i")).is_err());
        assert!(check_hash("secret").is_err() && check_hash("").is_err());
        for (cost, taken) in [
            ("m=65536,t=10,p=4", true),
            ("m=65537,t=10,p=4", false),
            ("m=65536,t=11,p=4", false),
            ("m=65536,t=10,p=5", false),
        ] {
            assert_eq!(check_hash(&DUMMY.replace("m=19456,t=2,p=1", cost)).is_ok(), taken, "{cost}");
        }
    }
}
