//! Each number of 64 bits keeps all its digits, whatever is done with it.

use proptest::prelude::*;

use super::*;

fn exact(text: &str) -> Exact {
    text.parse().expect("a number")
}

#[test]
fn the_numbers_around_what_an_f64_holds_keep_their_last_digit() {
    for number in [53, 60, 63, 64].map(|power| 1_i128 << power) {
        for number in [number - 1, number, number + 1, -number - 1, -number, 1 - number] {
            let whole = Exact::whole(number);
            assert_eq!((whole.to_string(), whole.as_whole()), (number.to_string(), Some(number)));
            assert_eq!(exact(&number.to_string()), whole);
            assert!(Exact::whole(number - 1) < whole && whole < Exact::whole(number + 1), "{number}");
            assert_eq!((whole - Exact::whole(number - 1), whole + 1.0.into() - whole), (1.0.into(), 1.0.into()));
        }
    }
    assert_ne!(Exact::whole((1 << 53) + 1), 2f64.powi(53));
    assert_eq!(Exact::whole(u64::MAX.into()).bits(), u64::MAX);
    assert_eq!(Exact::whole(-1).bits(), u64::MAX);
}

#[test]
fn a_sum_a_product_and_a_quotient_keep_what_is_known() {
    assert_eq!((exact("18446744073709551615") * 3.0.into()).to_string(), "55340232221128654845");
    assert_eq!((exact("18446744073709551615") / 5.0.into()).to_string(), "3689348814741910323");
    assert_eq!((exact("18446744073709551.615") - exact("18446744073709551.614")).near(), 0.001);
    // What is computed of a number that is rounded already has no more digits than that.
    let rounded = Exact::plain(2f64.powi(60));
    assert_eq!(
        [rounded + 1.0.into(), exact("9007199254740993") + rounded, rounded * exact("9007199254740993")]
            .map(Exact::as_whole),
        [None; 3]
    );
    assert_eq!(
        (exact("1e3").as_whole(), exact("1.5e3").as_whole(), exact("0.5").as_whole()),
        (Some(1_000), Some(1_500), None)
    );
    assert!("12a".parse::<Exact>().is_err() && !exact("inf").is_finite());
}

#[test]
fn an_ordinary_number_is_no_longer_than_before() {
    for number in [0.0, -0.0, 72.4, 1e-12, 999_999_999_999_999.0, f64::MAX] {
        let exact = Exact::from(number);
        assert_eq!((exact.rest(), exact.to_string()), (None, number.to_string()));
        assert_eq!(serde_json::to_string(&exact).ok(), serde_json::to_string(&number).ok());
    }
    assert_eq!(postcard::to_stdvec(&Exact::from(72.4)).map(|bytes| bytes.len()), Ok(9));
}

#[test]
fn a_number_has_one_form_only() {
    let short = exact("85369191335237.9");
    let quotient = exact("8536919133523790") / 100.0.into();
    let sum = exact("85369191335237.96") - exact("0.06");
    for same in [short, exact("85369191335237.90"), quotient, sum, Exact::of_parts(short.near(), Some(-0.00625))] {
        assert_eq!((same, same.rest(), same.mantissa(2)), (short, None, Some(8_536_919_133_523_790)));
        assert_eq!(same.to_string(), "85369191335237.9");
    }
    // An `f64` is it to the last digit, but would be written with fewer.
    let binary = exact("156777777344796.28125");
    assert_eq!((binary.near(), binary.rest()), (156_777_777_344_796.28, Some(0.0)));
    assert_eq!((binary.to_string().as_str(), binary.as_f64()), ("156777777344796.28125", None));
}

proptest! {
    #[test]
    fn every_64_bit_number_comes_back(number in any::<u64>(), decimals in 0_u32..7) {
        for mantissa in [i128::from(number), -i128::from(number)] {
            let value = Exact::decimal(mantissa, decimals).expect("it is not too long");
            prop_assert_eq!(value.mantissa(decimals), Some(mantissa));
            let json = serde_json::to_string(&value).expect("a number");
            let parts = postcard::to_stdvec(&value).expect("two parts");
            for copy in [exact(&value.to_string()), serde_json::from_str(&json).expect("it"), postcard::from_bytes(&parts).expect("it")] {
                prop_assert_eq!((copy, copy.mantissa(decimals)), (value, Some(mantissa)));
            }
        }
    }

    #[test]
    fn order_and_difference_are_those_of_the_numbers(a in any::<u64>(), apart in 0_u64..4096) {
        let (low, high) = (i128::from(a), i128::from(a) + i128::from(apart));
        prop_assert_eq!(Exact::whole(low).partial_cmp(&Exact::whole(high)), low.partial_cmp(&high));
        prop_assert_eq!((Exact::whole(high) - Exact::whole(low)).as_whole(), Some(high - low));
    }
}
