//! Every query through the socket, by everybody who may be at a terminal.

use super::*;

/// A new query does not compile until it has a row here; put it into [`queries`] as well.
fn of_query(query: &Query) -> Row {
    match query {
        Query::Series { .. } | Query::Journal { .. } | Query::Actions { .. } => look("", "-VTSL-"),
        Query::LineMinutes { .. } | Query::Values { .. } | Query::SampleTime { .. } => look("", "-VTSL-"),
        Query::Past { .. } | Query::Batches { .. } | Query::Unarchived { .. } | Query::Overview => look("", "-VTSL-"),
        Query::AlarmMetrics { .. } | Query::Report { .. } | Query::Reports { .. } => look("", "-VTSL-"),
        Query::Samples { .. } | Query::ControlRuns { .. } => look("", "-VTSL-"),
        Query::Registers(_) => look("", "--TS--"),
        Query::Audit { .. } => look("read audit log", "---S--"),
    }
}

fn registers(def: &PlantDef) -> LiveRead {
    let (device, point) = (&def.devices[0], def.tags[0].point);
    let spans = vec![AddressSpan { table: point.table, address: point.address, count: 1 }];
    LiveRead { line: device.line, unit: device.unit, spans, not_before: None, relearn: false }
}

fn queries(def: &PlantDef, to: Timestamp) -> Vec<Query> {
    let (from, limit, all) = (to - jiff::SignedDuration::from_secs(60), 10, String::new);
    vec![
        Query::Series { tags: vec![def.tags[0].id], from, to, buckets: 10 },
        Query::Journal { from, to, limit },
        Query::Actions { from, to, limit },
        Query::LineMinutes { line: LineId(0), from, to, limit },
        Query::Values { tags: vec![def.tags[0].id], from, every: std::time::Duration::from_secs(10), count: 6 },
        Query::AlarmMetrics { from, to },
        Query::Report { period: Period::free(from, to) },
        Query::SampleTime { tags: vec![def.tags[0].id], from, to, latest: true },
        Query::Past { at: to },
        Query::Batches { from, to, limit },
        Query::ControlRuns { controller: None, from, to, limit },
        Query::Reports { limit },
        Query::Samples { epoch: None, from, to },
        Query::Unarchived { from, to },
        Query::Overview,
        Query::Audit { from, to, words: all(), by: all(), action: all(), limit },
        Query::Registers(registers(def)),
    ]
}

#[tokio::test(flavor = "multi_thread")]
async fn every_query_is_permitted_or_refused_as_the_table_says() {
    let guarded = Guarded::start(|_| {}).await;
    let at = guarded.truth.borrow().at;
    for (person, name) in USERS.into_iter().enumerate() {
        let session = sits(&guarded, person).await;
        for query in queries(&guarded.def, at) {
            let row = of_query(&query);
            let said = format!("{query:?} by {name}");
            let written = guarded.entries().len();
            let (reply, answer) = oneshot::channel();
            session.ask(QueryRequest { query, reply }).unwrap();
            let answer = answer.await.unwrap();
            assert_eq!(answer.is_ok(), row.lets(person), "{said}: {answer:?}");
            let Err(error) = answer else { continue };
            assert!(error.to_string().contains(&row.why(person)), "{said}: {error}");
            if !row.action.is_empty() {
                let line = guarded.written(written, &said, |entry| &*entry.action == row.action).await;
                assert!(is_by(&line, person), "{said}: {line:?}");
                assert_eq!(*line.outcome, format!("refused: {}", row.why(person)), "{said}");
            }
        }
    }
    guarded.end().await;
}
