//! A host that answers no connection holds neither the end of its line nor its operator.

use std::{net::TcpStream, time::Duration};

use tokio::{
    net::{TcpListener, TcpSocket},
    sync::mpsc,
    time::Instant,
};

use super::slave::{Line, Mode, line_on, plant};
use crate::{
    bus::io::transport::Connector,
    plant::{
        PlantDef,
        command::{BusRequest, WriteId, WriteJob},
        def::{Framing, Protocol, TagId, Transport},
        event::{Event, WriteResult},
        fault::Fault,
        line_state::LineState,
    },
};

/// A listener whose queue is full: the system answers no further connection to it.
struct Unreachable {
    at: TcpListener,
    _queued: TcpStream,
}

impl Unreachable {
    fn new() -> Unreachable {
        let socket = TcpSocket::new_v4().expect("a socket");
        socket.bind(([127, 0, 0, 1], 0).into()).expect("a free port");
        let at = socket.listen(0).expect("it listens");
        let _queued = TcpStream::connect(at.local_addr().expect("it is bound")).expect("room for one");
        Unreachable { at, _queued }
    }

    /// A line to it that is being opened; `listens`: another master polls it.
    async fn line(&self, listens: bool) -> (PlantDef, Line) {
        let mut def = plant(Mode::Tcp);
        let (host, port) = ("127.0.0.1".to_owned(), self.at.local_addr().expect("it is bound").port());
        let framing = if listens { Framing::Rtu } else { Framing::Mbap };
        let transport = Transport::Network { protocol: Protocol::Tcp, host, port, framing };
        (def.lines[0].listens, def.lines[0].transport) = (listens, transport.clone());
        let mut line = line_on(def.clone(), mpsc::channel(1).0, Connector::Real(transport));
        let connects = |event: &Event| is_in(event, &LineState::Connecting).then_some(());
        line.until(&def, connects).await;
        (def, line)
    }
}

fn is_in(event: &Event, expect: &LineState) -> bool {
    matches!(event, Event::Line { state, .. } if state == expect)
}

#[tokio::test(start_paused = true)]
async fn a_stop_does_not_wait_for_an_unreachable_host() {
    let host = Unreachable::new();
    for listens in [false, true] {
        let (_, line) = host.line(listens).await;
        let asked = Instant::now();
        line.stop.send_replace(true);
        line.task.await.expect("it ends well");
        assert_eq!(asked.elapsed(), Duration::ZERO, "listens: {listens}");
    }
}

#[tokio::test(start_paused = true)]
async fn an_operator_closes_a_line_that_is_being_opened() {
    let host = Unreachable::new();
    for listens in [false, true] {
        let (def, mut line) = host.line(listens).await;
        let asked = Instant::now();
        line.requests.send(BusRequest::Connect(false)).await.expect("the line runs");
        line.until(&def, |event| is_in(event, &LineState::Disconnected).then_some(())).await;
        assert_eq!(asked.elapsed(), Duration::ZERO, "listens: {listens}");
    }
}

#[tokio::test(start_paused = true)]
async fn other_settings_do_not_wait_for_an_unreachable_host() {
    let host = Unreachable::new();
    let (def, mut line) = host.line(false).await;
    let reachable = TcpListener::bind("127.0.0.1:0").await.expect("a free port");
    let mut settings = def.lines[0].clone();
    settings.transport = Transport::tcp("127.0.0.1", reachable.local_addr().expect("it is bound").port());
    let asked = Instant::now();
    line.requests.send(BusRequest::Configure(Box::new(settings))).await.expect("the line runs");
    line.until(&def, |event| is_in(event, &LineState::Connected).then_some(())).await;
    assert_eq!(asked.elapsed(), Duration::ZERO);
}

/// What waited for the port is never sent later, when it is open.
#[tokio::test(start_paused = true)]
async fn a_write_is_refused_when_its_host_is_unreachable() {
    let host = Unreachable::new();
    let (def, mut line) = host.line(false).await;
    let job = WriteJob {
        id: WriteId(1),
        tag: TagId(0),
        raw: 1.0.into(),
        unlock: None,
        verify: true,
        urgent: false,
        over: None,
        unscaled_by: None,
    };
    line.requests.send(BusRequest::Write(job)).await.expect("the line runs");
    let ended = |event: &Event| match event {
        Event::Wrote { id: WriteId(1), result, .. } => Some(result.clone()),
        _ => None,
    };
    assert_eq!(line.until(&def, ended).await, WriteResult::NotSent(Fault::NotConnected));
}
