//! The process image: qualities, ages and what is recorded.

use super::*;
use crate::plant::fixture::{self, DP, FAULT, PV, RUN, SV, TIC};
use crate::plant::{
    fault::ExceptionCode,
    tag::{DataType, StorePolicy},
};

fn at(second: i64) -> Timestamp {
    Timestamp::from_second(second).expect("a small number")
}

fn image() -> ProcessImage {
    let mut image = ProcessImage::new(fixture::shared(), at(0));
    image.read(&[(PV, 724.0), (DP, 1.0), (FAULT, 0.0)], at(0));
    image
}

#[test]
fn a_value_needs_its_decimals_and_a_silent_fault_word() {
    let mut image = ProcessImage::new(fixture::shared(), at(0));
    assert_eq!(image.sample(PV).quality, Quality::Bad(Cause::NotRead));
    image.read(&[(PV, 724.0), (FAULT, 0.0)], at(1));
    assert_eq!(image.sample(PV).quality, Quality::Bad(Cause::Unscaled), "never 724 for 72.4");
    image.read(&[(DP, 1.0)], at(2));
    assert_eq!(image.sample(PV), Sample::good(72.4, at(1)), "as old as its own reading");
    image.read(&[(FAULT, 2.0)], at(3));
    assert_eq!(image.sample(PV).quality, Quality::Bad(Cause::SensorFault));
    assert_eq!(image.sample(PV).value, None);
}

#[test]
fn a_value_that_stays_bad_keeps_the_time_since_when() {
    let mut image = image();
    for second in [3, 30, 60] {
        image.read(&[(PV, 724.0), (FAULT, 2.0)], at(second));
        assert_eq!(image.sample(PV), Sample::bad(Cause::SensorFault, at(3)), "read at {second} s");
    }
    image.read(&[(PV, 724.0), (FAULT, 0.0)], at(61));
    assert_eq!(image.sample(PV), Sample::good(72.4, at(61)));
}

#[test]
fn a_text_is_trusted_and_doubted_like_a_number_and_never_stored() {
    let mut def = fixture::plant();
    (def.tags[PV.index()].point.kind, def.tags[PV.index()].store) = (DataType::Text(8), StorePolicy::Never);
    let mut image = ProcessImage::new(Arc::new(def), at(0));
    assert_eq!(image.texts[PV.index()], None);
    image.read_texts(&[(PV, "PXR4".into())], at(1));
    assert_eq!(image.sample(PV), Sample::new(None, Quality::Good, at(1)));
    image.failed(&[PV], Fault::Timeout, at(2));
    assert_eq!(image.sample(PV).quality, Quality::Uncertain(Cause::Timeout));
    assert_eq!(image.texts[PV.index()].as_deref(), Some("PXR4"), "doubtful, not gone");
    image.gone(TIC, Cause::NotConnected, at(3));
    assert_eq!(image.sample(PV).quality, Quality::Bad(Cause::NotConnected));
    assert_eq!(image.texts[PV.index()], None, "what is not known is not shown");
    let stored = |record: &Record| matches!(record, Record::Sample(tag, _) if *tag == PV);
    assert!(!image.records(at(4)).iter().any(stored));
}

#[test]
fn a_value_that_is_read_on_request_is_never_called_stale() {
    let mut def = fixture::plant();
    def.tags[SV.index()].poll = Poll::Never;
    let mut image = ProcessImage::new(Arc::new(def), at(0));
    let causes = [SV, DP].map(|tag| image.sample(tag).quality.cause());
    assert_eq!(
        causes,
        [Some(Cause::OnRequest), Some(Cause::NotRead)],
        "what is not polled does not wait for its first read"
    );
    image.read(&[(SV, 700.0), (DP, 1.0), (FAULT, 0.0)], at(0));
    for (second, quality) in [(60, Quality::Good), (61, Quality::Uncertain(Cause::OnRequest))] {
        image.age(at(second));
        assert_eq!((image.sample(SV).quality, image.sample(SV).value), (quality, Some(70.0)), "{second} s");
    }
    image.age(at(100_000));
    assert_eq!(image.sample(SV), Sample::good(70.0, at(0)).uncertain(Cause::OnRequest), "it is not dropped");
}

#[test]
fn an_impossible_number_of_decimals_is_no_scale() {
    for decimals in [65_535.0, -1.0, 7.0, 0.5] {
        let mut image = image();
        image.read(&[(DP, decimals), (PV, 724.0)], at(1));
        assert_eq!(image.sample(PV).quality, Quality::Bad(Cause::Unscaled), "{decimals} decimals");
    }
}

#[test]
fn a_signed_fault_word_counts_with_all_its_bits() {
    let mut image = image();
    image.read(&[(FAULT, f64::from(i16::MIN)), (PV, 724.0)], at(1));
    assert_eq!(image.sample(PV).quality, Quality::Bad(Cause::SensorFault));
    image.failed(&[PV], Fault::Timeout, at(2));
    image.read(&[(FAULT, 0.0)], at(3));
    assert_eq!(image.sample(PV).quality, Quality::Uncertain(Cause::Timeout), "not read since");
}

#[test]
fn trust_goes_with_failures() {
    use Quality::{Bad, Uncertain};
    for (fault, quality) in [
        (Fault::Timeout, Uncertain(Cause::Timeout)),
        (Fault::Crc { got: 1, computed: 2 }, Uncertain(Cause::Corrupt)),
        (Fault::Exception(ExceptionCode(2)), Bad(Cause::Exception)),
        (Fault::Exception(ExceptionCode(6)), Uncertain(Cause::Exception)),
        (Fault::NotANumber, Bad(Cause::SensorFault)),
        (Fault::NotConnected, Bad(Cause::NotConnected)),
        (Fault::BackedOff, Bad(Cause::DeviceDown)),
    ] {
        let mut image = image();
        image.failed(&[PV], fault, at(1));
        let sample = image.sample(PV);
        assert_eq!(sample.quality, quality);
        assert_eq!(sample.value.is_none(), quality.is_bad(), "{fault}: a bad sample has no value");
    }
}

/// The same values on the line of another master, each heard twice, a second apart.
fn heard() -> ProcessImage {
    let mut def = fixture::plant();
    def.lines[0].listens = true;
    let mut image = ProcessImage::new(Arc::new(def), at(-1));
    for second in [-1, 0] {
        image.read(&[(PV, 724.0), (DP, 1.0), (FAULT, 0.0)], at(second));
    }
    image
}

#[test]
fn what_is_not_heard_stands_for_its_period_and_no_longer() {
    for (fault, cause) in [
        (Fault::NotHeard, Cause::NotHeard),
        (Fault::Timeout, Cause::Timeout),
        (Fault::Crc { got: 1, computed: 2 }, Cause::Corrupt),
    ] {
        let mut image = heard();
        for second in 1..=3 {
            image.failed(&[PV], fault, at(second));
            image.age(at(second));
            assert_eq!(image.sample(PV), Sample::good(72.4, at(0)), "{fault} after {second} s");
        }
        image.age(at(4));
        assert_eq!(image.sample(PV).quality, Quality::Uncertain(cause), "{fault}");
        image.age(at(11));
        assert_eq!(image.sample(PV).quality, Quality::Bad(cause), "{fault}");
    }
    // Nothing was lost, the master has not read it.
    let mut image = heard();
    image.failed(&[PV], Fault::Timeout, at(1));
    image.read(&[(PV, 725.0)], at(2));
    image.age(at(6));
    assert_eq!(image.sample(PV).quality, Quality::Uncertain(Cause::NotHeard));
    // What says that there is no value counts at once.
    image.failed(&[DP], Fault::Exception(ExceptionCode(2)), at(6));
    assert_eq!(image.sample(DP).quality, Quality::Bad(Cause::Exception));
}

#[test]
fn what_is_not_proven_is_uncertain_and_scales_no_better() {
    let mut image = heard();
    image.read_unproven(&[(PV, 1.0.into())], &[], at(1));
    assert_eq!(image.sample(PV), Sample::good(72.4, at(0)), "what is known stays");
    let mut def = fixture::plant();
    def.lines[0].listens = true;
    let mut image = ProcessImage::new(Arc::new(def), at(0));
    image.read_unproven(&[(PV, 724.0.into()), (DP, 1.0.into()), (FAULT, 0.0.into())], &[], at(0));
    image.read(&[(PV, 724.0), (FAULT, 0.0)], at(1));
    let unproven = Quality::Uncertain(Cause::Unproven);
    assert_eq!(
        image.sample(PV),
        Sample { quality: unproven, ..Sample::good(72.4, at(1)) },
        "its decimals are not proven"
    );
    image.read(&[(DP, 1.0)], at(2));
    assert_eq!(image.sample(PV), Sample::good(72.4, at(1)));
}

#[test]
fn no_other_answer_revives_a_doubtful_value() {
    let mut image = image();
    image.failed(&[PV], Fault::Timeout, at(1));
    image.read(&[(FAULT, 0.0), (DP, 1.0)], at(2));
    assert_eq!(image.sample(PV).quality, Quality::Uncertain(Cause::Timeout));
    image.age(at(11));
    image.read(&[(FAULT, 0.0), (DP, 1.0)], at(12));
    assert_eq!(image.sample(PV).quality, Quality::Bad(Cause::Stale));
    image.read(&[(PV, 725.0)], at(13));
    assert_eq!(image.sample(PV), Sample::good(72.5, at(13)));
}

#[test]
fn values_age_by_their_own_period() {
    let mut image = image();
    for (second, quality) in [
        (3, Quality::Good),
        (4, Quality::Uncertain(Cause::Stale)),
        (10, Quality::Uncertain(Cause::Stale)),
        (11, Quality::Bad(Cause::Stale)),
    ] {
        image.age(at(second));
        assert_eq!(image.sample(PV).quality, quality, "after {second} s");
    }
    assert_eq!(image.sample(RUN).quality, Quality::Bad(Cause::NotRead));
}

#[test]
fn a_device_that_is_gone_takes_its_values_with_it() {
    let mut image = image();
    image.gone(TIC, Cause::NotConnected, at(5));
    assert_eq!(image.shown_decimals(fixture::shared().tag(PV)), 1, "what was keeps its decimals");
    assert_eq!(image.sample(PV), Sample::bad(Cause::NotConnected, at(5)));
    image.failed(&[PV], Fault::Timeout, at(6));
    assert_eq!(image.sample(PV).quality, Quality::Bad(Cause::NotConnected), "a probe in vain changes nothing");
}

/// How many samples of PV are stored of readings (second, raw) in tenths of a degree, with these settings.
fn stored(set: impl Fn(&mut TagDef), readings: &[(i64, f64)]) -> usize {
    let mut def = fixture::plant();
    set(&mut def.tags[PV.index()]);
    let mut image = ProcessImage::new(Arc::new(def), at(0));
    image.read(&[(DP, 1.0), (FAULT, 0.0)], at(0));
    let count = |records: Vec<Record>| {
        records.iter().filter(|record| matches!(record, Record::Sample(PV, sample) if sample.quality.is_good())).count()
    };
    let read = |&(second, raw): &(i64, f64)| {
        image.read(&[(PV, raw)], at(second));
        count(image.records(at(second)))
    };
    readings.iter().map(read).sum()
}

#[test]
fn a_value_is_stored_as_its_policy_says() {
    let slow: Vec<(i64, f64)> = (1..=10).map(|second| (second, 724.0 + 0.4 * second as f64)).collect();
    let still: Vec<(i64, f64)> = (1..=120).map(|second| (second, 724.0)).collect();
    // Half a tenth by default: 0.04 a second is stored every second time.
    assert_eq!(stored(|_| {}, &slow), 5);
    assert_eq!(stored(|tag| tag.deadband = Some(0.0), &slow), 10);
    assert_eq!(stored(|tag| tag.deadband = Some(0.3), &slow), 2);
    assert_eq!(stored(|_| {}, &still), 2);
    assert_eq!(stored(|tag| tag.store_every = Duration::from_secs(10), &still), 12);
    assert_eq!(stored(|tag| tag.store = StorePolicy::Always, &still), 120);
    assert_eq!(stored(|tag| tag.store = StorePolicy::Never, &slow), 0);
    // A whole number with labels is stored at each change.
    let steps: Vec<(i64, f64)> = (1..=10).map(|second| (second, second as f64)).collect();
    assert_eq!(stored(|tag| (tag.scale, tag.decimals) = (1.0, Decimals::Fixed(0)), &steps), 10);
}

#[test]
fn changes_are_stored_and_unchanged_values_once_a_minute() {
    let mut image = image();
    let count = |image: &mut ProcessImage, second| {
        let pv = |record: &Record| matches!(record, Record::Sample(tag, _) if *tag == PV);
        image.records(at(second)).iter().filter(|record| pv(record)).count()
    };
    assert_eq!(count(&mut image, 0), 1);
    for (second, raw, expect) in [(1, 724.0, 0), (2, 725.0, 1), (61, 725.0, 0), (62, 725.0, 1), (121, 725.0, 0)] {
        image.read(&[(PV, raw)], at(second));
        assert_eq!(count(&mut image, second), expect, "at {second} s");
    }
    image.failed(&[PV], Fault::Timeout, at(122));
    let records = image.records(at(122));
    let doubted = Sample::new(Some(72.5.into()), Quality::Uncertain(Cause::Timeout), at(122));
    assert!(records.contains(&Record::Sample(PV, doubted)), "the doubt begins at 122 s: {records:?}");
    assert_eq!(count(&mut image, 123), 0);
}
