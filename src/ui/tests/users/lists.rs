//! What every list can: the list of users and the audit log stand for all of them.

use super::*;

/// The audit log with these many entries, on the screen.
fn audit(count: u64) -> Model {
    let mut model = with(&Fixture::normal(), supervisor());
    let effects = type_keys(&mut model, "7j");
    let id = effects.iter().find_map(|effect| match effect {
        Effect::Query(id, Query::Audit { .. }) => Some(*id),
        _ => None,
    });
    let entry = |number| action(number, "anna", "write", &format!("TAG-{number}"), ("1", "2"), "verified");
    let entries = (1..=count).rev().map(entry).collect();
    update(&mut model, Msg::Answer(id.expect("it is asked for"), Ok(Answer::Actions(entries))));
    model
}

/// The names of the users, in the order of the rows.
fn names(model: &mut Model) -> Vec<&'static str> {
    let shown = screen(model, 80, 24);
    let mut names: Vec<_> = ["anna", "boris", "สมชาย", "tom"]
        .into_iter()
        .filter_map(|name| {
            Some((shown.lines().position(|line| line.trim_start_matches([' ', '▸']).starts_with(name))?, name))
        })
        .collect();
    names.sort_unstable();
    names.into_iter().map(|(_, name)| name).collect()
}

#[test]
fn a_list_is_filtered_while_words_are_typed() {
    let mut model = with(&Fixture::normal(), supervisor());
    type_keys(&mut model, "7/");
    shows(&mut model, "words that a row must have");
    for (typed, expect) in [("t", &["anna", "boris", "สมชาย", "tom"][..]), ("om", &["tom"]), ("x", &[])] {
        type_keys(&mut model, typed);
        assert_eq!(names(&mut model), expect, "{typed}");
    }
    shows(&mut model, "No matching entries.");
    type_keys(&mut model, "⎋");
    assert_eq!(names(&mut model).len(), 4, "cancelled");
    type_keys(&mut model, "/technician↓⏎");
    assert_eq!(names(&mut model), ["boris", "tom"]);
    shows(&mut model, "\"technician\": 2 of 4");
    let expect = SessionRequest::Disable { user: "tom".to_owned(), disabled: false };
    assert_eq!(sent_request(&type_keys(&mut model, "d⏎")), Some(&expect), "a key acts on the row that is selected");
    type_keys(&mut model, "⎋⎋");
    assert_eq!(names(&mut model).len(), 4, "Esc takes the filter away before it leaves the page");
}

#[test]
fn a_list_is_sorted_by_its_columns_and_as_at_first_again() {
    let mut model = with(&Fixture::normal(), supervisor());
    type_keys(&mut model, "7");
    let first = ["anna", "boris", "สมชาย", "tom"];
    assert_eq!(names(&mut model), first);
    let by_name = ["anna", "boris", "tom", "สมชาย"];
    let reversed = ["สมชาย", "tom", "boris", "anna"];
    for (keys, expect, words) in [("s", by_name, "sorted by user"), ("S", reversed, "sorted by user, reversed")] {
        type_keys(&mut model, keys);
        assert_eq!(names(&mut model), expect, "{keys}");
        shows(&mut model, words);
    }
    type_keys(&mut model, "sss");
    shows(&mut model, "sorted by last login");
    type_keys(&mut model, "s");
    assert_eq!(names(&mut model), first);
}

#[test]
fn marked_rows_are_copied_together_and_the_others_are_counted() {
    let mut model = audit(60);
    shows(&mut model, "more ▼");
    let copied = |effects: &[Effect]| {
        effects.iter().find_map(|effect| match effect {
            Effect::Copy(text) => {
                Some(text.lines().filter_map(|line| line.split('\t').nth(5)).collect::<Vec<_>>().join(" "))
            }
            _ => None,
        })
    };
    assert_eq!(copied(&type_keys(&mut model, "↓y")).as_deref(), Some("TAG-59"), "the selected one");
    assert_eq!(copied(&type_keys(&mut model, " ↓↓ y")).as_deref(), Some("TAG-59 TAG-57"));
    type_keys(&mut model, "⎋↑y");
    assert_eq!(copied(&type_keys(&mut model, "y")).as_deref(), Some("TAG-58"), "Esc takes the marks off");
}

#[test]
fn the_newest_row_is_selected_until_another_one_is() {
    let newest = |model: &mut Model| {
        let shown = screen(model, 80, 24);
        shown.lines().find(|line| line.contains('▸')).map(|line| line.contains("TAG-3")).expect("one is selected")
    };
    let mut model = audit(3);
    assert!(newest(&mut model));
    type_keys(&mut model, "↓↑");
    assert!(newest(&mut model));
    type_keys(&mut model, "↓");
    assert!(!newest(&mut model));
}

#[test]
fn active_alarms_are_filtered_while_words_are_typed() {
    let mut model = with(&Fixture::alarm(), supervisor());
    type_keys(&mut model, "3/tic-1");
    shows(&mut model, "FILTER \"tic-1\"");
    type_keys(&mut model, "⎋");
    assert!(!screen(&mut model, 80, 24).contains("FILTER"), "cancelled");
}
