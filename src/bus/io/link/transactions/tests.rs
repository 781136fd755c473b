//! Transaction ids, and frames in datagrams.

use jiff::Timestamp;
use tokio::net::UdpSocket;

use super::*;
use crate::{
    bus::io::{
        clock::Clock,
        memory::LineMemory,
        tests::slave::{Mode, plant},
        transport::Connector,
    },
    plant::def::{Protocol, Transport},
};

#[test]
fn the_id_of_an_abandoned_request_is_not_used_again() {
    let mut transactions = Transactions::new();
    let id = transactions.begin(&[1, 3, 0, 0, 0, 1], Duration::from_secs(1), Instant::now());
    transactions.under_way[0].sent_at = Some(Instant::now());
    transactions.give_up_all();
    for _ in 0..=u16::MAX {
        let later = transactions.begin(&[1, 3, 0, 9, 0, 1], Duration::from_secs(1), Instant::now());
        assert_ne!(later, id, "its reply is outstanding");
        transactions.under_way.clear();
    }
    assert!(matches!(transactions.take(id), Owner::Unknown), "it is not late: no time was given to it");
}

/// A link to a device on this computer that takes datagrams.
async fn udp_link(framing: Framing) -> (Link, UdpSocket) {
    let device = UdpSocket::bind("127.0.0.1:0").await.unwrap();
    let port = device.local_addr().unwrap().port();
    let mut def = plant(Mode::Tcp);
    def.lines[0].transport = Transport::Network { protocol: Protocol::Udp, host: "127.0.0.1".into(), port, framing };
    def.lines[0].timeout = Duration::from_millis(150);
    let opened = Connector::Real(def.lines[0].transport.clone()).open().await.unwrap();
    let (line, clock) = (&def.lines[0], Clock::starting_at(Timestamp::UNIX_EPOCH, 1.0));
    (Link::new(opened, line, clock, LineMemory::new(line, clock)), device)
}

/// Asks for as many registers as an answer may have; the device answers with these datagrams, made of the right answer.
async fn ask(
    (link, device): &mut (Link, UdpSocket),
    datagrams: impl Fn(&[u8]) -> Vec<Vec<u8>>,
) -> Result<Vec<u8>, Fault> {
    let framing = link.framing();
    let answer = || async {
        let mut request = [0; frame::FRAME_MAX];
        let (count, from) = device.recv_from(&mut request).await.unwrap();
        let id = if framing == Framing::Mbap { u16::from_be_bytes([request[0], request[1]]) } else { 0 };
        assert!(frame::unwrap(framing, &request[..count]).is_ok());
        for datagram in datagrams(&frame::wrap(framing, id, &longest())) {
            device.send_to(&datagram, from).await.unwrap();
        }
    };
    let (answer, ()) = tokio::join!(link.exchange(&[1, 3, 0, 0, 0, 125]), answer());
    answer.map_err(|error| match error {
        LinkError::Fault(fault) => fault,
        LinkError::Gone(why) => panic!("{framing:?}: {why}"),
    })
}

fn longest() -> Vec<u8> {
    [&[1, 3, 250][..], &[0x2A; 250]].concat()
}

#[tokio::test]
async fn a_datagram_cut_short_costs_no_more_than_its_answer() {
    for framing in [Framing::Mbap, Framing::Rtu, Framing::Ascii] {
        let mut line = udp_link(framing).await;
        assert_eq!(ask(&mut line, |whole| vec![whole.to_vec()]).await, Ok(longest()), "{framing:?}");
        let cut = ask(&mut line, |whole| vec![whole[..40].to_vec()]).await;
        assert!(matches!(cut, Err(Fault::Truncated { .. })), "{framing:?}: {cut:?}");
        assert_eq!(ask(&mut line, |whole| vec![whole.to_vec()]).await, Ok(longest()), "{framing:?}");
        // Two that would make an answer are none; a whole one behind them is.
        let pieces = |whole: &[u8]| vec![whole[..40].to_vec(), whole[40..].to_vec()];
        assert!(ask(&mut line, pieces).await.is_err(), "{framing:?}");
        let after = |whole: &[u8]| vec![whole[..40].to_vec(), b"HTTP/1.1 400".to_vec(), whole.to_vec()];
        assert_eq!(ask(&mut line, after).await, Ok(longest()), "{framing:?}");
    }
}

#[tokio::test]
async fn an_exception_with_a_wrong_length_ends_with_its_datagram() {
    let mut line = udp_link(Framing::Mbap).await;
    let exception = |whole: &[u8]| vec![[&whole[..2], &[0, 0, 0, 4, 1, 0x83, 2]].concat()];
    let refused = ask(&mut line, exception).await;
    assert!(matches!(refused, Err(Fault::Exception(_))), "{refused:?}");
}
