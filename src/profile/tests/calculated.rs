//! Calculated tags of plant files.

mod identities;

use super::*;
use crate::plant::{
    calculation_def::OverTime,
    delay::{Delay, Edge},
    totalizer::Total,
};

#[test]
fn errors_of_a_calculated_tag_are_shown_at_their_place() {
    let with = |keys: &str| {
        let tag = format!("fast = \"1s\"\n\n[[device.tag]]\nname = \"DEV\"\n{keys}\n");
        load(PLANT.replacen("fast = \"1s\"\n", &tag, 1).as_bytes(), METER, PLC)
    };
    for words in ["T - 5", "D1.T - 5 * (T + 1)", "max(T, 5, abs(T))", "T > 5 and T <= T + 2", "mean(T, T) / 2"] {
        let def = with(&format!("expr = '{words}'")).unwrap_or_else(|errors| panic!("{words}: {errors}"));
        let tag = def.tag(def.tag_named("D1.DEV").expect("it is there"));
        let calculation = tag.calculation.as_ref().expect("it is calculated");
        assert_eq!((calculation.inputs(), tag.is_stored()), (vec![def.tag_named("D1.T").expect("it is there")], true));
    }
    for (words, total, counter) in [
        ("integral(T - 5)", Total::Integral, ""),
        ("on_time(T > 5 and T < 9)", Total::OnTime, ""),
        ("starts(D1.MODE = on)", Total::Starts, "\ncounter = false"),
    ] {
        let def = with(&format!("expr = '{words}'{counter}")).unwrap_or_else(|errors| panic!("{words}: {errors}"));
        let tag = def.tag(def.tag_named("D1.DEV").expect("it is there"));
        assert_eq!(
            tag.calculation.as_ref().map(|calculation| calculation.over_time),
            Some(Some(OverTime::Total(total)))
        );
        assert_eq!(tag.counter, Some(counter.is_empty()), "a report gives its difference");
    }
    for (words, edge, ms) in
        [("on_delay(T > 5, 10 s)", Edge::On, 10_000), ("off_delay(MODE = on, 500ms)", Edge::Off, 500)]
    {
        let def = with(&format!("expr = '{words}'")).unwrap_or_else(|errors| panic!("{words}: {errors}"));
        let tag = def.tag(def.tag_named("D1.DEV").expect("it is there"));
        let delay = Delay { edge, time: std::time::Duration::from_millis(ms) };
        assert_eq!(
            tag.calculation.as_ref().and_then(|calculation| calculation.over_time),
            Some(OverTime::Delay(delay))
        );
        assert_eq!(tag.counter, None, "{words}");
    }
    for (keys, expect) in [
        ("expr = 'on_delay(T > 5)'", "`,` and a time are missing"),
        ("expr = 'on_delay(T > 5, soon)'", "`soon` is not a time"),
        ("expr = 'on_delay(T > 5, 10 s'", "a parenthesis is not closed"),
        ("expr = 'on_delay(T, 10 s)'", "this is a number, not a condition"),
        ("expr = 'not off_delay(T > 5, 10 s)'", "`off_delay` cannot be part of an expression"),
        ("expr = 'on_delai(T > 5, 10 s)'", "did you mean `on_delay`?"),
        ("expr = 'T -'", "a tag is missing"),
        ("expr = 'T - Q'", "unknown tag `Q` in D1"),
        ("expr = 'T - D1.TT'", "did you mean `D1.T`?"),
        ("expr = 'maxi(T)'", "did you mean `max`?"),
        ("expr = 'abs(T, T)'", "abs is of one number"),
        ("expr = 'max(T'", "a parenthesis is not closed"),
        ("expr = 'integral(T) / 2'", "`/` is one too many"),
        ("expr = '2 * integral(T)'", "`integral` cannot be part of an expression"),
        ("expr = 'max(on_time(T), 5)'", "`on_time` cannot be part of an expression"),
        ("expr = 'integral(T, T)'", "a parenthesis is not closed"),
        ("expr = 'integral()'", "a tag is missing"),
        ("expr = 'integrals(T)'", "did you mean `integral`?"),
        ("expr = 'starts(T > 5)'\nstore = \"never\"", "a total that is not stored"),
        ("expr = 'T 5'", "`5` is one too many"),
        ("expr = 'DEV + T'", "D1.DEV → D1.DEV"),
        ("expr = 'T'\naddress = 7", "`address` is for what is read from a device"),
        ("type = 'int16'", "a tag needs `address`"),
    ] {
        let found = with(keys).expect_err(keys).to_string();
        assert!(found.contains(expect), "{keys}: {found}");
    }
}
