//! One terminal as the station serves it: queries that are cancelled, replies on their way.
#![allow(clippy::unwrap_used)]

use jiff::Timestamp;
use tokio::{
    io::{AsyncReadExt, AsyncWriteExt, DuplexStream},
    sync::watch,
    task::JoinHandle,
};

use super::*;
use crate::{
    access::{Completion, Durability, Peer, SessionEnd},
    attach::io::shared::SnapshotSender,
    plant::fixture,
    station::SessionAcceptor,
};

/// A terminal that is served: what it writes to, and what the station is asked.
fn serving() -> (DuplexStream, mpsc::Receiver<(u32, Request)>, JoinHandle<ConnectionEnd>) {
    let (publish, snapshots) = watch::channel(Arc::new(Snapshot::blank(fixture::shared())));
    let (sender, shared) = SnapshotSender::new(snapshots.borrow().clone());
    let (acceptor, attach_requests, requests) = SessionAcceptor::new(snapshots);
    let session = acceptor.attach(Peer { from: "test".into(), unix_user: None, in_process: false });
    let (near, far) = tokio::io::duplex(REQUEST_BYTES_MAX);
    let (read, write) = tokio::io::split(near);
    let served = tokio::spawn(async move {
        let _station = (publish, sender, attach_requests);
        serve(read, write, session, shared).await
    });
    (far, requests, served)
}

async fn say(far: &mut DuplexStream, asked: &ClientMessage) {
    far.write_all(&protocol::encode(asked, REQUEST_BYTES_MAX).unwrap()).await.unwrap();
}

fn query(ticket: u64) -> ClientMessage {
    let (from, to) = (Timestamp::UNIX_EPOCH, Timestamp::from_second(9).unwrap());
    ClientMessage::Ask { ticket, query: Query::Journal { from, to, limit: 1 } }
}

async fn next_query(requests: &mut mpsc::Receiver<(u32, Request)>) -> QueryRequest {
    let Some((_, Request::Ask(query))) = requests.recv().await else { panic!("no query") };
    query
}

async fn is_cancelled(query: &mut QueryRequest) -> bool {
    timeout(Duration::from_secs(60), query.reply.closed()).await.is_ok()
}

#[tokio::test(start_paused = true)]
async fn queries_of_a_terminal_that_has_left_are_cancelled() {
    let (mut far, mut requests, served) = serving();
    say(&mut far, &query(1)).await;
    let mut query = next_query(&mut requests).await;
    drop(far);
    assert!(is_cancelled(&mut query).await, "the history is still working on it");
    assert!(matches!(served.await.unwrap(), ConnectionEnd::Wire(_)));
}

#[tokio::test(start_paused = true)]
async fn a_job_of_a_terminal_that_has_left_is_cancelled() {
    let (mut far, mut requests, served) = serving();
    say(&mut far, &ClientMessage::SessionRequest { ticket: 1, request: SessionRequest::Reload }).await;
    let Some((_, Request::SessionRequest(_, mut reply))) = requests.recv().await else { panic!("no request") };
    assert!(timeout(Duration::from_secs(60), reply.closed()).await.is_err(), "its answer is awaited");
    drop(far);
    assert!(matches!(served.await.unwrap(), ConnectionEnd::Wire(_)));
    assert!(timeout(Duration::from_secs(60), reply.closed()).await.is_ok());
}

#[tokio::test(start_paused = true)]
async fn a_cancelled_query_makes_room_for_another() {
    let (mut far, mut requests, _served) = serving();
    let last = ANSWERS_MAX as u64 + 1;
    for ticket in 1..=last {
        say(&mut far, &query(ticket)).await;
    }
    let mut asked = Vec::new();
    for _ in 1..last {
        asked.push(next_query(&mut requests).await);
    }
    assert!(timeout(Duration::from_secs(60), requests.recv()).await.is_err(), "more than a terminal may ask at a time");
    // One that was never asked, and one that is being answered.
    say(&mut far, &ClientMessage::Cancel { ticket: 99 }).await;
    say(&mut far, &ClientMessage::Cancel { ticket: 2 }).await;
    assert!(is_cancelled(&mut asked[1]).await, "the history is still working on it");
    assert!(!asked[0].reply.is_closed() && !asked[2].reply.is_closed(), "others are not touched");
    let mut next = next_query(&mut requests).await;
    assert!(!is_cancelled(&mut next).await);
}

#[tokio::test(start_paused = true)]
async fn a_reply_on_its_way_reaches_a_terminal_that_is_sent_away() {
    let (_publish, snapshots) = watch::channel(Arc::new(Snapshot::blank(fixture::shared())));
    let (sender, shared) = SnapshotSender::new(snapshots.borrow().clone());
    let (acceptor, mut attach_requests, mut requests) = SessionAcceptor::new(snapshots);
    let session = acceptor.attach(Peer { from: "test".into(), unix_user: None, in_process: false });
    let status = attach_requests.recv().await.unwrap().status;
    status.send_replace(Arc::default());
    let (near, mut far) = tokio::io::duplex(1 << 20);
    let (read, write) = tokio::io::split(near);
    let mut served = tokio::spawn(serve(read, write, session, shared));
    say(&mut far, &ClientMessage::SessionRequest { ticket: 7, request: SessionRequest::Reload }).await;
    let Some((_, Request::SessionRequest(_, reply))) = requests.recv().await else { panic!("no request") };
    sender.publish(Arc::new(Snapshot::blank(fixture::shared())));
    assert!(timeout(Duration::from_secs(1), &mut served).await.is_err(), "it goes without its reply");
    let completion = Completion::new(Durability::Recorded, Some("line L1 keeps running".to_owned()));
    reply.send(Ok(completion.clone())).unwrap();
    assert!(matches!(served.await.unwrap(), ConnectionEnd::OtherPlant));
    let mut bytes = Vec::new();
    far.read_to_end(&mut bytes).await.unwrap();
    let done = ServerMessage::RequestDone { ticket: 7, answer: Ok(completion) };
    assert!(bytes.ends_with(&protocol::encode(&done, SERVER_MESSAGE_BYTES_MAX).unwrap()));
}

#[tokio::test(start_paused = true)]
async fn a_terminal_that_is_sent_away_learns_why() {
    let (_publish, snapshots) = watch::channel(Arc::new(Snapshot::blank(fixture::shared())));
    let (_sender, shared) = SnapshotSender::new(snapshots.borrow().clone());
    let (acceptor, mut attach_requests, _requests) = SessionAcceptor::new(snapshots);
    let session = acceptor.attach(Peer { from: "test".into(), unix_user: None, in_process: false });
    let why = SessionEnd::TooMany { count: 64, user: None };
    let gone = SessionStatus { gone: Some(why.clone()), ..SessionStatus::default() };
    attach_requests.recv().await.unwrap().status.send_replace(Arc::new(gone));
    let (near, mut far) = tokio::io::duplex(REQUEST_BYTES_MAX);
    let (read, write) = tokio::io::split(near);
    let ended = serve(read, write, session, shared).await;
    assert!(matches!(ended, ConnectionEnd::SentAway));
    let reply = wire::read(&mut far, SERVER_MESSAGE_BYTES_MAX).await.unwrap();
    assert_eq!(protocol::handshake_reply(&reply).unwrap().unwrap_err(), why.to_string());
}
