//! Messages survive the way over the socket; whatever else comes is refused in words and without harm.
#![allow(clippy::unwrap_used)]

use proptest::prelude::*;

use super::*;
use std::{sync::Arc, time::Duration};

use crate::plant::alarm::AlarmCommand;
use crate::{
    access::Durability,
    attach::check,
    plant::{
        command::CommandKind,
        def::{AlarmId, DeviceId, LineDef, LineId, ProcedureId, TagId},
        diagnostics::Diagnostic,
        role::Role,
    },
    ui::fixture::{Fixture, now},
};

fn body(bytes: Vec<u8>) -> Vec<u8> {
    let length = length(bytes[..LENGTH_BYTES].try_into().unwrap(), usize::MAX).unwrap();
    assert_eq!(length, bytes.len() - LENGTH_BYTES);
    bytes[LENGTH_BYTES..].to_vec()
}

fn place() -> TerminalOrigin {
    TerminalOrigin { tty: Some("pts/3".into()), ssh: Some("10.0.0.5".into()), term: Some("xterm".into()) }
}

#[test]
fn a_handshake_has_place_and_plant() {
    let hello_bytes = body(encode(&(Handshake::current(), place()), HANDSHAKE_BYTES_MAX).unwrap());
    assert_eq!(client_handshake(&hello_bytes), Ok(place()));
    let def = Fixture::normal().snapshot().def.clone();
    let sent = HandshakeReply { run: 7, terminal: 3, def: def.clone() };
    let bytes = body(encode(&(Handshake::current(), sent), SERVER_MESSAGE_BYTES_MAX).unwrap());
    let received = handshake_reply(&bytes).unwrap().unwrap();
    assert_eq!((received.run, received.terminal), (7, 3));
    assert_eq!(encode(&received.def, usize::MAX), encode(&def, usize::MAX));
}

#[test]
fn different_versions_are_refused_with_what_to_do() {
    let old = Handshake { protocol: PROTOCOL + 1, version: "9.9".into(), ..Handshake::current() };
    // Whatever follows in that version is not read.
    let bytes = body(encode(&(old, vec![0xFFu8; 40]), HANDSHAKE_BYTES_MAX).unwrap());
    let Err(ProtocolError::OtherVersion(why)) = client_handshake(&bytes) else { panic!("taken for one of ours") };
    let expected =
        format!("this terminal is version 9.9 (protocol {}), the station is version {VERSION}", PROTOCOL + 1);
    assert!(why.starts_with(&expected) && why.ends_with("restart the older one after an update"), "{why}");
    let Err(ProtocolError::OtherVersion(why)) = handshake_reply(&bytes) else { panic!("taken for one of ours") };
    assert!(why.starts_with(&format!("this terminal is version {VERSION}")), "{why}");
    let other_build = Handshake { version: "0.0.1".into(), ..Handshake::current() };
    let bytes = body(encode(&(other_build, place()), HANDSHAKE_BYTES_MAX).unwrap());
    assert!(matches!(client_handshake(&bytes), Err(ProtocolError::OtherVersion(_))));
    let bytes = body(encode(&(Handshake::current(), vec![0xFFu8; 40]), HANDSHAKE_BYTES_MAX).unwrap());
    let Err(ProtocolError::OtherVersion(why)) = handshake_reply(&bytes) else { panic!("taken for one of ours") };
    assert!(why.ends_with("restart it"), "{why}");
    let bytes = body(encode(&Handshake::rejected("full, wait\x1b[2J"), HANDSHAKE_BYTES_MAX).unwrap());
    assert_eq!(handshake_reply(&bytes).unwrap().unwrap_err(), "full, wait[2J");
}

#[test]
fn the_place_of_a_terminal_is_one_harmless_line() {
    let rows: [(&str, &str, &str); 5] = [
        ("pts/3", "10.0.0.5", "pts/3 from 10.0.0.5, user panel, process 123"),
        ("", "", "no terminal, user panel, process 123"),
        ("\x1b[2Jpts/3\n", "10.0.0.5\r\u{202E}", "[2Jpts/3 from 10.0.0.5, user panel, process 123"),
        ("pts/3, user root", "", "pts/3. user root, user panel, process 123"),
        ("ทดสอบ", "fe80::1%eth0", "ทดสอบ from fe80::1%eth0, user panel, process 123"),
    ];
    for (tty, ssh, expected) in rows {
        let place = TerminalOrigin { tty: Some(tty.into()), ssh: Some(ssh.into()), term: None };
        assert_eq!(place.words(Some("panel"), Some(123)), expected);
    }
    let long = TerminalOrigin { tty: Some("x".repeat(10_000)), ssh: Some("y".repeat(10_000)), term: None };
    assert_eq!(long.words(None, None).chars().count(), 64 + " from ".len() + 64);
    assert!(encode(&(Handshake::current(), long.short()), HANDSHAKE_BYTES_MAX).is_ok());
}

#[test]
fn requests_and_news_survive_the_way() {
    let command =
        Command::new(7, CommandId { terminal: 1, number: 2 }, CommandKind::Write { tag: TagId(0), value: 0.1.into() });
    let asked = [
        ClientMessage::Command(Box::new(command), None),
        ClientMessage::Ask { ticket: 1, query: Query::Journal { from: now(), to: now(), limit: 5 } },
        ClientMessage::Cancel { ticket: 1 },
        ClientMessage::SessionRequest {
            ticket: 2,
            request: SessionRequest::Login { user: "anna".into(), password: "long and secret".into() },
        },
        ClientMessage::SessionRequest {
            ticket: 3,
            request: SessionRequest::SetRole { user: "anna".into(), role: Role::Technician },
        },
    ];
    for asked in asked {
        assert_eq!(decode(&body(encode(&asked, REQUEST_BYTES_MAX).unwrap()), "message"), Ok(asked));
    }
    let sent = [
        ServerMessage::SessionStatus(Box::default()),
        ServerMessage::Answer { ticket: 1, answer: Ok(Answer::Journal(Vec::new())) },
        ServerMessage::Answer { ticket: 1, answer: Err(HistoryError::EmptyPeriod) },
        ServerMessage::RequestDone { ticket: 2, answer: Err(RequestRefusal::WrongPassword { wait: 8 }) },
        ServerMessage::Undelivered { id: CommandId { terminal: 1, number: 2 }, why: RequestRefusal::StationBusy },
    ];
    for sent in sent {
        let received: ServerMessage =
            decode(&body(encode(&sent, SERVER_MESSAGE_BYTES_MAX).unwrap()), "message").unwrap();
        assert_eq!(format!("{received:?}"), format!("{sent:?}"));
    }
}

#[test]
fn a_flood_of_alarms_is_handled_by_one_message() {
    let ids: Arc<[AlarmId]> = (0..10_000).map(AlarmId).collect();
    let all = AlarmCommand::AcknowledgeAll { alarms: None, seen: u64::MAX };
    let many = AlarmCommand::AcknowledgeAll { alarms: Some(ids.clone()), seen: u64::MAX };
    let shelve = AlarmCommand::Shelve { alarms: ids, lasts: Duration::from_secs(600) };
    let bytes = |command: AlarmCommand| {
        let command = Command::new(1, CommandId { terminal: 1, number: 1 }, CommandKind::Alarm(command));
        encode(&ClientMessage::Command(Box::new(command), None), REQUEST_BYTES_MAX).unwrap().len()
    };
    assert!(bytes(all) < 100);
    assert!(bytes(many).max(bytes(shelve)) < REQUEST_BYTES_MAX / 2);
}

#[test]
fn a_message_is_neither_longer_nor_shorter_than_it_says() {
    assert_eq!(length([0, 0, 1, 0], REQUEST_BYTES_MAX), Ok(65_536));
    assert_eq!(length([1, 0, 1, 0], REQUEST_BYTES_MAX), Err(ProtocolError::TooLong { bytes: 65_537, max: 65_536 }));
    assert!(length([0xFF; 4], SERVER_MESSAGE_BYTES_MAX).is_err());
    let answer = Ok(Completion { durability: Durability::Recorded, summary: None });
    let mut bytes = body(encode(&ServerMessage::RequestDone { ticket: 2, answer }, 100).unwrap());
    bytes.push(0);
    assert!(decode::<ServerMessage>(&bytes, "message").is_err(), "something is left over");
    assert!(decode::<ServerMessage>(&bytes[..2], "message").is_err(), "something is missing");
    let long = ClientMessage::SessionRequest {
        ticket: 1,
        request: SessionRequest::Unlock("x".repeat(70_000).as_str().into()),
    };
    assert!(matches!(encode(&long, REQUEST_BYTES_MAX), Err(ProtocolError::TooLong { .. })));
}

#[test]
fn what_this_plant_does_not_have_never_reaches_it() {
    let def = Fixture::normal().snapshot().def.clone();
    let far = u16::MAX;
    let commands = [
        CommandKind::Write { tag: TagId(far), value: 1.0.into() },
        CommandKind::Alarm(AlarmCommand::Reset(AlarmId(far))),
        CommandKind::Refresh(DeviceId(far)),
        CommandKind::Connect(LineId(far), true),
        CommandKind::SaveSettings(LineId(far)),
        CommandKind::StopTest(LineId(far)),
        CommandKind::SaveSet { device: DeviceId(far), name: "x".into(), replace: false },
        CommandKind::StopRestore(DeviceId(far)),
        CommandKind::StartProcedure(ProcedureId(far)),
    ];
    for kind in commands {
        let why = check::command(&def, &kind).unwrap_err();
        assert!(why.contains("number 65535"), "{kind:?}: {why}");
    }
    let long = [
        CommandKind::SaveSet { device: DeviceId(0), name: "x".repeat(33).into(), replace: false },
        CommandKind::Test(LineId(0), Diagnostic::Send(vec![0; 514])),
        CommandKind::Configure(Box::new(LineDef { name: "x".repeat(5_000), ..def.lines[0].clone() })),
    ];
    for kind in long {
        let why = check::command(&def, &kind).unwrap_err();
        assert!(why.contains("expected"), "{why}");
    }
    assert_eq!(check::command(&def, &CommandKind::Configure(Box::new(def.lines[0].clone()))), Ok(()));
    assert_eq!(check::command(&def, &CommandKind::Write { tag: TagId(0), value: 1.0.into() }), Ok(()));
    let series = |tags: Vec<TagId>, buckets| Query::Series { tags, from: now(), to: now(), buckets };
    let report = |days: i64| {
        let to = now() + jiff::SignedDuration::from_hours(24 * days);
        Query::Report { period: crate::report::Period::free(now(), to) }
    };
    assert_eq!(check::query(&def, &series(vec![TagId(0)], 200)), Ok(()));
    assert_eq!(check::query(&def, &report(5 * 366)), Ok(()));
    for wrong in [
        series(vec![TagId(far)], 200),
        series(vec![TagId(0)], usize::MAX),
        series(vec![TagId(0)], 0),
        series(vec![TagId(0); 1_000], 200),
        series(vec![TagId(0); 64], 4_096),
        Query::LineMinutes { line: LineId(far), from: now(), to: now(), limit: 1 },
        Query::LineMinutes { line: LineId(0), from: now(), to: now(), limit: 10_001 },
        Query::Journal { from: now(), to: now(), limit: usize::MAX },
        Query::Actions { from: now(), to: now(), limit: usize::MAX },
        report(5 * 366 + 1),
    ] {
        assert!(check::query(&def, &wrong).is_err(), "{wrong:?}");
    }
}

proptest! {
    #[test]
    fn random_bytes_are_refused_without_harm(bytes in prop::collection::vec(any::<u8>(), 0..600)) {
        let _ = client_handshake(&bytes);
        let _ = handshake_reply(&bytes).map(|sent| sent.map(|_| ()));
        let _ = decode::<ClientMessage>(&bytes, "message");
        let _ = decode::<ServerMessage>(&bytes, "message");
    }

    #[test]
    fn a_corrupt_message_is_refused_without_harm(place in 0usize..200, byte: u8, end in 0usize..200) {
        let credentials = crate::access::Credentials { user: Some("somchai".into()), password: "secret".into() };
        let command = Command {
            note: Some("because".into()),
            ..Command::new(7, CommandId { terminal: 1, number: 2 }, CommandKind::Write { tag: TagId(3), value: 7.5.into() })
        };
        let mut bytes = body(encode(&ClientMessage::Command(Box::new(command), Some(credentials)), REQUEST_BYTES_MAX).unwrap());
        let place = place % bytes.len();
        bytes[place] = byte;
        bytes.truncate(bytes.len() - end % bytes.len());
        if let Ok(ClientMessage::Command(command, _)) = decode::<ClientMessage>(&bytes, "message") {
            let _ = check::command(&Fixture::normal().def, &command.kind);
        }
    }
}
