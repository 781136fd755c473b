//! What `send`, `decode` and `probe` make of answers of every function, of odd ones, of pasted bytes, and of a port that others have open.

use std::fs::OpenOptions;

use crate::{
    peers::slave,
    support::{Cable, Process, folder, free_port, have, libmodbus_server, python, sightglass},
    tools::{answers, peer, run},
};

/// A device over TCP that answers a request message with a message.
fn device(answer: impl Fn(&[u8]) -> Vec<u8> + Send + 'static) -> String {
    peer(answers(move |request| {
        let message = answer(&request[6..]);
        let length = u16::try_from(message.len()).unwrap().to_be_bytes();
        [&request[..4], &length, &message].concat()
    }))
}

#[test]
fn send_takes_a_request_for_no_header() {
    let unit = device(|request| match request[1] {
        16 => request[..6].to_vec(),
        23 => [&[1, 23, 10][..], &[0; 10]].concat(),
        _ => vec![1, request[1] | 0x80, 1],
    });
    for bytes in ["01 10 00 00 00 02 04 00 01 00 02", "01 17 00 00 00 05 00 0A 00 01 02 00 05"] {
        let (code, said) = run(&["send", &unit, "--yes", bytes]);
        assert!(code == Some(0) && said.contains("ok, after"), "{code:?} {said}");
        assert!(said.contains(&format!("0{:X} {bytes}", bytes.split(' ').count())), "with a header before it: {said}");
    }
}

#[test]
fn send_compares_every_field_of_an_answer() {
    let unit = device(|request| match request[1] {
        // Another OR mask, and eleven bytes that are ten.
        22 => [&request[..6], &[0, 0]].concat(),
        23 => [&[1, 23, 11][..], &[0; 10]].concat(),
        _ => vec![1, 1, 0],
    });
    for (bytes, why) in [
        ("01 16 00 6F FF 00 00 12", "the response does not repeat the request"),
        ("01 17 00 00 00 05 00 0A 00 01 02 00 05", "response with 11 data bytes, expected 10"),
        ("01 06 00 66 00 01", "response to function 1 / 0x01, expected 6 / 0x06"),
    ] {
        let (code, said) = run(&["send", &unit, "--yes", bytes]);
        assert!(code == Some(1) && said.contains(&format!("not the response to this: {why}")), "{code:?} {said}");
    }
    let next = peer(answers(|request| vec![0, request[1] + 1, 0, 0, 0, 5, 1, 3, 2, 0, 7]));
    let (code, said) = run(&["send", &next, "01 03 00 00 00 01", "--timeout", "200"]);
    assert!(code == Some(1) && said.contains("response has transaction 2, the request had 1"), "{code:?} {said}");
    // The answer behind that of another request.
    let both = peer(answers(|_| [[0, 9, 0, 0, 0, 5, 1, 3, 2, 0, 7], [0, 1, 0, 0, 0, 5, 1, 3, 2, 0, 8]].concat()));
    let (code, said) = run(&["send", &both, "01 03 00 00 00 01"]);
    assert!(
        code == Some(0) && said.contains("1 register: 0008") && said.contains("11 bytes before it"),
        "{code:?} {said}"
    );
}

#[test]
fn an_exception_with_a_wrong_header_is_understood_and_named() {
    for (surplus, words) in [(&[][..], "its header says 4 bytes, 3 follow"), (&[0], "1 byte behind the exception code")]
    {
        let unit = peer(answers(move |request| [&request[..4], &[0, 4, 1, request[7] | 0x80, 2], surplus].concat()));
        let (code, said) = run(&["send", &unit, "01 03 00 00 00 01", "--timeout", "200"]);
        assert!(
            code == Some(0) && said.contains("illegal data address, after") && said.contains(words),
            "{code:?} {said}"
        );
    }
}

#[test]
fn decode_finds_frames_among_other_bytes_and_says_why() {
    let (code, said) = run(&["decode", "FF 00 01 03 00 00 00 01 84 0A 55 01 03 02 00 07 F9 86 33"]);
    assert_eq!(code, Some(0), "{said}");
    for words in [
        "2 RTU frames, 4 bytes in no frame; read as RTU: the CRC fits",
        "bytes 0–1 are in no frame: FF 00",
        "RTU request: unit 1 read holding registers 40001",
        "byte 10 is in no frame: 55",
        "40001 / 0x0000  0x0007  7",
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }
    let tcp = "DE AD 00 01 00 00 00 06 01 03 00 0A 00 01 BE EF 00 01 00 00 00 05 01 03 02 00 07";
    let (code, said) = run(&["decode", tcp]);
    assert!(code == Some(0) && said.contains("2 TCP frames") && said.contains("40011 / 0x000A"), "{code:?} {said}");
    let (code, said) = run(&["decode", "\\xff:010300000001FB..:0103020007F3"]);
    assert!(code == Some(0) && said.contains("2 ASCII frames") && said.contains("the LRC fits"), "{code:?} {said}");
    // Its CRC looks like a request behind a header.
    let (code, said) = run(&["decode", "01 03 00 00 00 02 C4 0B"]);
    assert!(code == Some(0) && said.contains("RTU request") && said.contains("may also be TCP"), "{code:?} {said}");
    let (code, said) = run(&["decode", "10:00:01.250 got 01 03 00 00 00 01 84 0A, 8 bytes"]);
    assert!(code == Some(0) && said.contains("RTU request"), "words of a log are left out: {code:?} {said}");
    let (code, said) = run(&["decode", "TX 01 03 00 00 00 01 84 0A\nRX 01 03 02 00 07 F9 86"]);
    assert!(code == Some(0) && said.contains("RTU answer") && said.contains("40001 / 0x0000"), "{code:?} {said}");
}

#[test]
fn probe_lists_each_object_once_and_the_extended_ones() {
    let unit = device(|request| match request {
        &[1, 0x2B, 0x0E, code, object] => {
            let text: &[u8] = if code == 3 { b"serial 0815" } else { b"DRV-11" };
            let id = if code == 3 { object } else { 1 };
            [&[1, 0x2B, 0x0E, code, 3, 0, 0, 1, id, u8::try_from(text.len()).unwrap()], text].concat()
        }
        _ => vec![1, request[1] | 0x80, 1],
    });
    let (code, said) = run(&["probe", &unit]);
    assert!(code == Some(0) && said.contains("private object 128 / 0x80  serial 0815"), "{code:?} {said}");
    assert_eq!(said.matches("DRV-11").count(), 1, "{said}");
}

#[test]
fn who_has_a_port_open_is_named() {
    if !have("socat", "socat") {
        return;
    }
    let folder = folder();
    let cable = Cable::plug(folder.path());
    let name = cable.ends[0].file_name().unwrap().to_str().unwrap();
    let probe = || {
        let output = sightglass().args(["probe", name, "--timeout", "20"]).current_dir(folder.path()).output().unwrap();
        String::from_utf8([output.stdout, output.stderr].concat()).unwrap()
    };
    let said = probe();
    assert!(said.contains(&format!("unit 1 on RTU {}", cable.ends[0].display())), "a relative path: {said}");
    assert!(!said.contains("open in"), "what serves the port is no other program: {said}");
    let mut listener = Process::start(sightglass().args(["listen", cable.ends[0].to_str().unwrap(), "--for", "60s"]));
    listener.wait_for("nothing is sent");
    let said = probe();
    assert!(said.contains(&format!("(process {})", listener.child.id())) && said.contains(" listen "), "{said}");
    drop(listener);
    let other = OpenOptions::new().read(true).write(true).open(&cable.ends[0]).unwrap();
    let said = probe();
    let own = format!("(process {}): each takes bytes from the other", std::process::id());
    assert!(said.contains("is also open in") && said.contains(&own), "{said}");
    drop(other);
}

#[test]
fn every_function_of_pymodbus_is_answered_as_it_should_be() {
    let Some(python) = python() else { return };
    for (kind, mode) in [("tcp", "tcp"), ("rtu-over-tcp", "rtu-over-tcp")] {
        let port = free_port();
        let _slave = slave(&python, kind, &port.to_string());
        for request in [
            "03 01 00 00 00 05",
            "03 02 00 00 00 13",
            "03 03 00 00 00 02",
            "03 04 00 00 00 7D",
            "03 05 00 00 FF 00",
            "03 06 00 00 00 05",
            "03 07",
            "03 08 00 00 12 34",
            "03 08 00 0B 00 00",
            "03 0B",
            "03 0C",
            "03 0F 00 00 00 02 01 03",
            "03 10 00 00 00 02 04 00 01 00 02",
            "03 11",
            // Its record has ten registers, whatever is asked for.
            "03 14 07 06 00 01 00 00 00 0A",
            "03 15 09 06 00 01 00 00 00 01 12 34",
            "03 16 00 04 00 F2 00 25",
            "03 17 00 00 00 02 00 0A 00 01 02 00 05",
            "03 18 00 00",
            "03 2B 0E 01 00",
        ] {
            let place = format!("127.0.0.1:{port}");
            let output = sightglass().args(["send", &place, "--mode", mode, "--yes", request]).output().unwrap();
            let said = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
            assert!(output.status.success() && said.contains("   ok, after"), "{mode} {request}: {said}");
        }
    }
}

#[test]
fn libmodbus_is_identified_on_one_connection() {
    // Its server ends with its first connection, and takes half a second to refuse a function that it does not know.
    let Some(_server) = libmodbus_server() else { return };
    let probe = ["probe", "127.0.0.1:1502", "--unit", "17", "--timeout", "3000"];
    let output = sightglass().args(probe).output().unwrap();
    let said = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
    assert!(said.contains("exception 01, illegal function") && said.contains("ServerId"), "{said}");
}
