//! Many tags read at once, piece by piece: the answers are those of each tag read by itself, and damage costs no more than
//! it must.

use duckdb::params;
use proptest::prelude::*;

use super::*;
use crate::{
    history::{
        series::{Curve, Span, grid},
        tiers::Tier,
    },
    plant::{exact::Exact, sample::Quality},
    report::{figures::TagDescription, step_series::HOLD_MAX, testing::figures_of},
};

/// The samples of a tag in order of time, as one plain query has them.
fn by_itself(store: &Store, tag: TagId) -> Vec<Sample> {
    let sql = "SELECT utc, value, quality FROM sample WHERE tag = ? ORDER BY utc, rowid";
    let mut statement = store.db.prepare(sql).unwrap();
    let row = |row: &duckdb::Row| {
        let at = Timestamp::from_microsecond(row.get(0)?).unwrap();
        let value: Option<f64> = row.get(1)?;
        Ok(Sample::new(value.map(Into::into), Quality::from_code(row.get(2)?).unwrap(), at))
    };
    statement.query_map(params![tag.0], row).unwrap().map(Result::unwrap).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn a_query_about_many_tags_is_answered_as_each_by_itself(
        rows in proptest::collection::vec((0u16..3, -60i64..600, proptest::option::weighted(0.8, -1e3f64..1e3)), 0..300),
        from in -100i64..300,
        length in 1i64..900,
        buckets in 1usize..50,
    ) {
        let (_folder, db) = folder();
        let mut store = open(&db, 0);
        store.piece = 16;
        let records: Vec<Record> = rows.iter().map(|&(tag, at, value)| {
            let sample = value.map_or(Sample::bad(Cause::Timeout, sec(at)), |value| Sample::good(value, sec(at)));
            Record::Sample(TagId(tag), sample)
        }).collect();
        // Some are in the file, the others in the log.
        let (one, other) = records.split_at(records.len() / 2);
        store.append(one).unwrap();
        store.checkpoint().unwrap();
        store.append(other).unwrap();
        let (from, to) = (sec(from), sec(from + length));
        let until = to - Duration::from_secs(1);
        let tags = [2, 0, 2, 1].map(TagId);
        let query = Query::Series { tags: tags.to_vec(), from, to, buckets };
        let samples = |tag, from: Timestamp| by_itself(&store, tag).into_iter().filter(move |s| from - HOLD_MAX <= s.at && s.at < to);
        let curve = |tag| {
            let (span, buckets, _) = grid(Span { from, to, until }, buckets, Tier::Raw);
            let mut curve = Curve::new(tag, span, buckets);
            samples(tag, span.from).for_each(|sample| curve.next(sample));
            curve.end()
        };
        prop_assert_eq!(store.answer(&query, until), Ok(Answer::Series(tags.map(curve).to_vec())));
        if from < until {
            let period = Period::free(from, to);
            let Ok(Answer::Report(report)) = store.answer(&Query::Report { period }, until) else { panic!("no report") };
            for (place, row) in report.tags.iter().enumerate() {
                let figures = figures_of(samples(TagId(place as u16), from).filter(|s| s.at < until), from, until);
                let label = TagDescription { tag: row.tag.clone(), unit: row.unit.clone(), decimals: row.decimals, counts: false };
                prop_assert_eq!(row, &figures.end(label, Exact::default(), Duration::ZERO));
            }
            let stood = |tag: usize, at: Timestamp| by_itself(&store, TagId(tag as u16)).into_iter()
                .rfind(|sample| sample.at <= at)
                .filter(|sample| at < sample.at + HOLD_MAX)
                .and_then(Sample::good_exact);
            for row in &report.record {
                prop_assert_eq!((row.pv, row.sv), (stood(0, row.at), stood(1, row.at)));
            }
        }
    }
}

#[test]
fn a_damaged_block_costs_the_period_of_its_rows_and_is_named() {
    let (_folder, db) = folder();
    let store = open(&db, 0);
    let rows = 400_000;
    // Numbers that do not compress: many blocks.
    let value = |at: i64| f64::from((at as u32).wrapping_mul(2_654_435_761)) / 7.0;
    for rows in (0..rows).collect::<Vec<i64>>().chunks(50_000) {
        store.append(&rows.iter().map(|at| good(PV, *at, value(*at))).collect::<Vec<_>>()).unwrap();
    }
    store.checkpoint().unwrap();
    // One that has values alone.
    let sql = "SELECT block_id FROM pragma_storage_info('sample') WHERE block_id > 0 GROUP BY block_id
               HAVING count(*) = 1 AND any_value(column_name) = 'value' ORDER BY block_id LIMIT 1 OFFSET 3";
    let block: u64 = store.db.query_row(sql, [], |row| row.get(0)).unwrap();
    drop(store);
    let mut file = std::fs::File::options().read(true).write(true).open(&db).unwrap();
    // Blocks of 256 KiB follow three headers of 4 KiB.
    let place = std::io::SeekFrom::Start(12_288 + block * 262_144 + 1_000);
    let mut byte = [0];
    std::io::Seek::seek(&mut file, place).unwrap();
    std::io::Read::read_exact(&mut file, &mut byte).unwrap();
    std::io::Seek::seek(&mut file, place).unwrap();
    std::io::Write::write_all(&mut file, &[byte[0] ^ 4]).unwrap();
    drop(file);
    let handle = thread::start(&db, def(), Clock::starting_at(sec(rows), 1.0)).unwrap();
    let (reply, answer) = tokio::sync::oneshot::channel();
    let period = Period::free(sec(0), sec(rows));
    handle.queries.blocking_send((1, QueryRequest { query: Query::Report { period }, reply })).unwrap();
    let answer = answer.blocking_recv().unwrap();
    let Ok(Answer::Report(report)) = answer else { panic!("{answer:?}") };
    let lost: i64 = report.unreadable.iter().map(|gap| gap.to.duration_since(gap.from).as_secs()).sum();
    assert!(0 < lost && lost < rows / 2, "{:?}", report.unreadable);
    assert!(report.unreadable[0].why.contains("checksum"), "{:?}", report.unreadable);
    let good = 1.0 - lost as f64 / rows as f64;
    assert!((report.tags[0].good - good).abs() < 0.01, "{} {good}", report.tags[0].good);
    // It is shown to the operator, and recording goes on.
    let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
    let mut status = handle.status.clone();
    let reported = |status: &crate::plant::snapshot::HistoryStatus| {
        status.trouble.as_ref().is_some_and(|words| words.contains("cannot be read"))
    };
    runtime.block_on(status.wait_for(reported)).unwrap();
    handle.records.blocking_send(vec![good_at(rows + 5)].into()).unwrap();
    runtime.block_on(status.wait_for(|status| status.rows == 1)).unwrap();
    handle.stop();
}

fn good_at(at: i64) -> Record {
    good(PV, at, 27.0)
}
