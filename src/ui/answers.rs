//! What the station answers to a request is English, because it stands in the audit log too; here a terminal reads it in its language.

use crate::text::{fill, translation};

/// Answers by their texts in `access`, with names for what differs. A test finds each of them there.
fn words() -> &'static [&'static str] {
    &[
        "wrong name or password",
        "wrong name or password; wait {seconds} s",
        "password not checked after wrong ones; wait {seconds} s",
        "too many requests from this terminal, wait a moment",
        "the station is busy with other logins, try again",
        "the login or the password has changed in the meantime, try again",
        "another change is being saved, try again",
        "login is disabled: {why}",
        "log in first",
        "log in, or unlock this terminal, first",
        "choose a new password first",
        "this terminal is locked",
        "this is for a {needed}, you are {role}",
        "this station has no users",
        "there is no user {name}",
        "user {name} already exists",
        "users already exist",
        "at least one enabled supervisor must remain",
        "only the user who started the station creates the first Supervisor",
        "a name has 1 to {most} characters, this has {count}",
        "this is the current password, choose another one",
        "the operating system identifies you here; there is no password to change",
        "the password must not be the name of the user",
        "this password is too common",
        "the password has {chars} characters, at least {least} are needed; several words are best",
        "this tag requires your password again",
        "this tag requires your own password",
        "this tag requires a second user",
        "the station was restarted since this was shown: check and confirm again",
    ]
}

/// An answer of the station in the language of this thread, as it is where it is none of the known ones.
pub fn said(answer: &str) -> String {
    let known = |pattern: &&'static str| Some((translation(pattern)?, values(pattern, answer)?));
    let found = words().iter().find_map(known);
    found.map_or_else(
        || answer.to_owned(),
        |(translated, values)| {
            let values: Vec<(&str, &dyn std::fmt::Display)> =
                values.iter().map(|(name, value)| (*name, value as &dyn std::fmt::Display)).collect();
            fill(translated, &values)
        },
    )
}

/// What stands in the places of a pattern; `None` if the text does not fit it.
fn values<'a>(pattern: &'static str, text: &'a str) -> Option<Vec<(&'static str, &'a str)>> {
    let (before, mut places) = pattern.split_once('{').map_or((pattern, None), |(before, rest)| (before, Some(rest)));
    let mut text = text.strip_prefix(before)?;
    let mut values = Vec::new();
    while let Some((name, after)) = places.and_then(|rest| rest.split_once('}')) {
        let (between, next) = after.split_once('{').map_or((after, None), |(between, rest)| (between, Some(rest)));
        let end = if next.is_none() { text.strip_suffix(between)?.len() } else { text.find(between)? };
        values.push((name, &text[..end]));
        (text, places) = (&text[end + between.len()..], next);
    }
    text.is_empty().then_some(values)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::text::Language;

    #[test]
    fn an_answer_is_read_in_the_language_of_the_terminal() {
        let thai = |answer: &str| Language::THAI.locale().within(|| said(answer));
        assert_eq!(said("wrong name or password; wait 8 s"), "wrong name or password; wait 8 s");
        assert_eq!(thai("wrong name or password; wait 8 s"), "ชื่อผู้ใช้\u{200b}หรือรหัสผ่าน\u{200b}ไม่ถูกต้อง; รอ 8 s");
        assert!(thai("this is for a supervisor, you are viewer").contains("supervisor"));
        assert_eq!(thai("the disk is full"), "the disk is full");
    }

    #[test]
    fn the_places_of_a_pattern_are_found() {
        assert_eq!(values("a {x} b {y}", "a 1 2 b 3"), Some(vec![("x", "1 2"), ("y", "3")]));
        assert_eq!(values("{x} s", "8 s"), Some(vec![("x", "8")]));
        assert_eq!((values("a {x} b", "a 1 c"), values("a", "ab")), (None, None));
    }
}
