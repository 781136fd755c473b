//! Hostile, old, foreign and too many connections.

use super::*;

#[tokio::test(start_paused = true)]
async fn hostile_connections_are_closed_and_disturb_no_other() {
    let mut stand = Stand::start();
    let mut session = stand.session().await;
    let mut long = handshake();
    long[..4].copy_from_slice(&u32::MAX.to_le_bytes());
    let command = asked(&ClientMessage::SessionRequest { ticket: 1, request: SessionRequest::Stop });
    let hostile: Vec<(&str, Vec<u8>)> = vec![
        ("nothing at all", Vec::new()),
        ("random bytes", (0..4_000u32).map(|n| (n.wrapping_mul(2_654_435_761) >> 24) as u8).collect()),
        ("a giant length", long),
        ("a length and nothing", 4_000u32.to_le_bytes().to_vec()),
        ("half a handshake", handshake()[..9].to_vec()),
        ("a right message before the handshake", command.clone()),
        ("an empty message", vec![0; 4]),
        ("a giant message after the handshake", [handshake(), u32::MAX.to_le_bytes().to_vec()].concat()),
        ("noise after the handshake", [handshake(), vec![3, 0, 0, 0, 250, 251, 252]].concat()),
        ("the handshake twice", [handshake(), handshake()].concat()),
        ("half a message after the handshake", [handshake(), command[..5].to_vec()].concat()),
    ];
    for (index, (what, bytes)) in hostile.into_iter().enumerate() {
        let mut stream = UnixStream::connect(stand.path()).await.unwrap();
        // It may be closed before all is sent.
        let _ = stream.write_all(&bytes).await;
        let closed = tokio::time::timeout(TIMEOUT, stream.read_to_end(&mut Vec::new())).await;
        assert!(closed.is_ok(), "still open: {what}");
        stand.set(index as f64);
        sees(&mut session, index as f64).await;
    }
    stand.until_present(1).await;
}

#[tokio::test(start_paused = true)]
async fn an_old_terminal_is_refused_with_what_to_do() {
    let stand = Stand::start();
    let mut stream = UnixStream::connect(stand.path()).await.unwrap();
    let old = Handshake { protocol: 0, version: "0.0.9".into(), ..Handshake::current() };
    stream.write_all(&protocol::encode(&(old, ()), HANDSHAKE_BYTES_MAX).unwrap()).await.unwrap();
    let bytes = until_closed(&mut stream).await;
    let why = protocol::handshake_reply(&bytes[LENGTH_BYTES..]).unwrap().unwrap_err();
    assert!(why.contains("0.0.9 (protocol 0)") && why.contains("restart the older one"), "{why}");
}

#[tokio::test(start_paused = true)]
async fn a_command_of_another_terminal_or_unknown_tag_is_rejected() {
    let stand = Stand::start();
    let mut stream = UnixStream::connect(stand.path()).await.unwrap();
    stream.write_all(&handshake()).await.unwrap();
    let own = protocol::handshake_reply(&next(&mut stream).await).unwrap().unwrap().terminal;
    let command = |terminal, kind| {
        asked(&ClientMessage::Command(Box::new(Command::new(0, CommandId { terminal, number: 1 }, kind)), None))
    };
    for (bytes, expected) in [
        (command(own + 1, CommandKind::Alarm(AlarmCommand::Silence)), "this is terminal"),
        (command(own, CommandKind::Write { tag: TagId(u16::MAX), value: 1.0.into() }), "tag number 65535"),
    ] {
        stream.write_all(&bytes).await.unwrap();
        let why = loop {
            if let ServerMessage::Undelivered { why, .. } =
                protocol::decode(&next(&mut stream).await, "message").unwrap()
            {
                break why;
            }
        };
        assert!(why.to_string().contains(expected), "{why}");
    }
    assert_eq!(*stand.asked.borrow(), 0);
}

#[tokio::test(start_paused = true)]
async fn a_thousand_silent_connections_keep_no_terminal_out() {
    let mut stand = Stand::start();
    // In ten waves, because a process may not hold a thousand sockets.
    for wave in 0..10 {
        let mut silent = Vec::new();
        for _ in 0..100 {
            silent.push(UnixStream::connect(stand.path()).await.unwrap());
            tokio::task::yield_now().await;
        }
        let mut session = stand.session().await;
        stand.set(f64::from(wave));
        sees(&mut session, f64::from(wave)).await;
        for stream in &mut silent {
            until_closed(stream).await;
        }
        drop(session);
        stand.until_present(0).await;
    }
}

#[tokio::test(start_paused = true)]
async fn one_terminal_too_many_is_refused_with_the_reason() {
    let mut stand = Stand::start();
    let mut sessions = Vec::new();
    for _ in 0..TERMINALS_MAX {
        sessions.push(stand.session().await);
    }
    let why = connect(&stand.path()).await.unwrap_err().to_string();
    assert!(why.contains("64 terminals"), "{why}");
    sessions.pop();
    stand.until_present(TERMINALS_MAX - 1).await;
    sessions.push(stand.session().await);
}

/// A flood waits in the flooding terminal: the station takes no more than a person can ask.
#[tokio::test(start_paused = true)]
async fn a_flood_of_queries_waits_where_it_comes_from() {
    let stand = Stand::start();
    let mut quick = stand.session().await;
    let mut flood = Plain::connect(stand.path()).unwrap();
    flood.set_nonblocking(true).unwrap();
    flood.write_all(&handshake()).unwrap();
    let at = stand.publish.borrow().at;
    let query = asked(&ClientMessage::Ask { ticket: 1, query: Query::Journal { from: at, to: at, limit: 1 } });
    let started = tokio::time::Instant::now();
    let (mut sent, mut begun) = (0, 0);
    for value in 0..200 {
        // As much as the socket takes; what did not fit goes first in the next round.
        while let Ok(count) = flood.write(&query[begun..]) {
            begun = (begun + count) % query.len();
            sent += usize::from(begun == 0);
        }
        stand.set(f64::from(value));
        sees(&mut quick, f64::from(value)).await;
    }
    let taken = *stand.asked.borrow();
    let seconds = started.elapsed().as_secs_f64();
    assert!(taken as f64 <= 64.0 + 50.0 * (seconds + 1.0), "{taken} of {sent} queries were taken in {seconds} s");
    assert!(taken < sent, "nothing has waited: {taken} of {sent}");
}
