//! Where words and signs begin and end.

use super::*;

#[test]
fn words_signs_and_parentheses_need_no_spaces() {
    let check = |text: &str, expect: &[&str]| {
        let found: Vec<&str> = tokens(text).into_iter().map(|(_, word)| word).collect();
        assert_eq!(found, expect, "{text}");
    };
    check("PLC-1.RUN=RUN and(T.L>=5.5 cm)", &["PLC-1.RUN", "=", "RUN", "and", "(", "T.L", ">=", "5.5", "cm", ")"]);
    check("a!=b ! <", &["a", "!=", "b", "!", "<"]);
    check("ü.ß = 1", &["ü.ß", "=", "1"]);
    check("a - b*2", &["a", "-", "b", "*", "2"]);
    check("a >= '2.10 or so' and b=\"x = y\"", &["a", ">=", "'2.10 or so'", "and", "b", "=", "\"x = y\""]);
    check("a = d'eau 5' 7\"", &["a", "=", "d'eau", "5'", "7\""]);
    check("", &[]);
}
