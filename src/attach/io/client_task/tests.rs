//! What a terminal sends to its station, and what it makes of the messages that come.
#![allow(clippy::unwrap_used)]

use jiff::Timestamp;
use tokio::net::UnixStream;

use super::*;
use crate::{
    history::Query,
    plant::{
        command::{Command, CommandKind},
        fixture,
    },
};

#[tokio::test]
async fn an_abandoned_query_is_cancelled_at_the_station() {
    let (publish, _snapshots) = watch::channel(Arc::new(Snapshot::blank(fixture::shared())));
    let (status_sender, _status) = watch::channel(Arc::new(SessionStatus::default()));
    let (id_map, assembly) = (CommandIdMap::new(1, 1), Assembly::new(fixture::shared()));
    let mut task = ClientTask::new(PathBuf::new(), TerminalOrigin::default(), id_map, assembly, publish, status_sender);
    let (near, mut far) = UnixStream::pair().unwrap();
    let (read, write) = near.into_split();
    let (asks, mut requests) = mpsc::channel(4);
    tokio::spawn(async move { task.serve(read, write, &mut requests).await });
    let query = Query::Journal { from: Timestamp::UNIX_EPOCH, to: Timestamp::UNIX_EPOCH, limit: 1 };
    let ask = || {
        let (reply, answer) = oneshot::channel();
        asks.try_send((1, Request::Ask(QueryRequest { query: query.clone(), reply }))).unwrap();
        answer
    };
    let mut asked = async || {
        protocol::decode::<ClientMessage>(&wire::read(&mut far, REQUEST_BYTES_MAX).await.unwrap(), "message").unwrap()
    };
    let first = ask();
    assert_eq!(asked().await, ClientMessage::Ask { ticket: 1, query: query.clone() });
    drop(first);
    let _second = ask();
    assert_eq!(asked().await, ClientMessage::Ask { ticket: 2, query: query.clone() });
    assert_eq!(asked().await, ClientMessage::Cancel { ticket: 1 }, "the second is waited for");
    let _third = ask();
    assert_eq!(asked().await, ClientMessage::Ask { ticket: 3, query: query.clone() }, "cancelled once");
}

/// As in the process of the station: in the session status, not among the commands that the station has checked.
#[tokio::test]
async fn an_undelivered_command_is_in_the_session_status() {
    let (publish, snapshots) = watch::channel(Arc::new(Snapshot::blank(fixture::shared())));
    let (status_sender, status) = watch::channel(Arc::new(SessionStatus::default()));
    // The station knows it as terminal 5.
    let mut id_map = CommandIdMap::new(1, 3);
    id_map.on_connected(1, 5);
    let assembly = Assembly::new(fixture::shared());
    let mut task = ClientTask::new(PathBuf::new(), TerminalOrigin::default(), id_map, assembly, publish, status_sender);
    let (out, _outbound) = mpsc::channel(4);
    let command = |number| {
        let id = CommandId { terminal: 3, number };
        Request::Command(Command::new(1, id, CommandKind::TakeOver), None)
    };
    let check = |expect: &[(u32, &RequestRefusal)]| {
        let seen = status.borrow().undelivered.clone();
        let seen: Vec<_> = seen.iter().map(|(id, why)| (id.terminal, id.number, why)).collect();
        let expect: Vec<_> = expect.iter().map(|(number, why)| (3, *number, *why)).collect();
        assert_eq!(seen, expect);
        assert_eq!(snapshots.borrow().commands, [], "the plant has not seen it");
    };
    (1..=3).for_each(|number| task.send(command(number), &out));
    let (at_station, why) = (|number| CommandId { terminal: 5, number }, RequestRefusal::TooManyRequests);
    task.on_message(ServerMessage::Undelivered { id: at_station(1), why: why.clone() }).unwrap();
    check(&[(1, &why)]);
    let undelivered = vec![(at_station(2), RequestRefusal::OtherRun)];
    let session = SessionStatus { undelivered, ..SessionStatus::default() };
    task.on_message(ServerMessage::SessionStatus(Box::new(session))).unwrap();
    check(&[(1, &why), (2, &RequestRefusal::OtherRun)]);
    task.on_message(ServerMessage::SessionStatus(Box::default())).unwrap();
    task.refuse(command(4));
    check(&[(1, &why), (2, &RequestRefusal::OtherRun), (4, &RequestRefusal::StationGone)]);
}
