//! The tools for a line without a plant, against peers that echo, chatter and lie: what they say, and how they end.

use std::{
    fs::OpenOptions,
    io::{Read, Write},
    net::{Ipv4Addr, Ipv6Addr, TcpListener, TcpStream},
    process::Command,
};

use crate::support::{Cable, Process, folder, have, sightglass};

/// A peer that does this with every connection. Gives its address.
pub fn peer(work: impl Fn(TcpStream) + Send + 'static) -> String {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let address = listener.local_addr().unwrap().to_string();
    serve(listener, work);
    address
}

fn serve(listener: TcpListener, work: impl Fn(TcpStream) + Send + 'static) {
    std::thread::spawn(move || listener.incoming().flatten().for_each(work));
}

/// A peer that gives this for every request it gets.
pub fn answers(answer: impl Fn(&[u8]) -> Vec<u8> + Send + 'static) -> impl Fn(TcpStream) + Send + 'static {
    move |mut stream| {
        let mut buffer = [0; 300];
        while let Ok(length @ 1..) = stream.read(&mut buffer) {
            if stream.write_all(&answer(&buffer[..length])).is_err() {
                break;
            }
        }
    }
}

/// Exit code, and all that was said.
pub fn run(args: &[&str]) -> (Option<i32>, String) {
    let output = sightglass().args(args).output().unwrap();
    let said = [output.stdout, output.stderr].concat();
    (output.status.code(), String::from_utf8(said).unwrap())
}

fn with_crc(message: &[u8]) -> Vec<u8> {
    sightglass::api::bus::frame::wrap(sightglass::api::plant::Framing::Rtu, 0, message)
}

#[test]
fn an_echo_of_the_adapter_is_no_loopback_of_the_unit() {
    let echo = peer(answers(<[u8]>::to_vec));
    let (code, said) = run(&["loopback", &echo, "--mode", "rtu-over-tcp", "--timeout", "50"]);
    assert!(code == Some(1) && said.contains("none of 10 came back"), "{code:?} {said}");

    // The same adapter with a unit behind it, which has no function 03.
    let unit = peer(answers(|request| {
        let answer = if request[1] == 3 { with_crc(&[1, 0x83, 1]) } else { request.to_vec() };
        [request, &answer].concat()
    }));
    let (code, said) = run(&["loopback", &unit, "--mode", "rtu-over-tcp", "--timeout", "500"]);
    assert!(code == Some(0) && said.contains("10 of 10 came back"), "{code:?} {said}");
}

#[test]
fn options_behind_the_bytes_are_options() {
    let unit = peer(answers(|_| vec![0, 1, 0, 0, 0, 5, 1, 3, 2, 0, 7]));
    let (code, said) = run(&["send", &unit, "01", "03", "00", "00", "00", "01", "--timeout", "2000"]);
    assert!(code == Some(0) && said.contains("ok, after"), "{code:?} {said}");
    let (code, said) = run(&["decode", "01", "03", "00", "00", "00", "01", "84", "0A", "--rtu"]);
    assert!(code == Some(0) && said.contains("RTU request"), "{code:?} {said}");
}

#[test]
fn send_asks_before_it_changes_something() {
    let unit = peer(answers(|_| vec![0, 1, 0, 0, 0, 6, 1, 6, 0, 5, 0, 7]));
    let (code, said) = run(&["send", &unit, "01 06 00 05 00 07"]);
    assert!(code == Some(2) && said.contains("nothing was sent") && said.contains("--yes"), "{code:?} {said}");
    let (code, said) = run(&["send", &unit, "--yes", "01 06 00 05 00 07"]);
    assert!(code == Some(0) && said.contains("ok, after"), "{code:?} {said}");
    for more in [&[][..], &["--force"], &["--as-is"]] {
        let two = "00 01 00 00 00 06 01 03 00 00 00 01 00 02 00 00 00 06 01 06 00 05 00 07";
        let (code, said) = run(&[&["send", &unit, two], more].concat());
        assert!(code == Some(2) && said.contains("nothing was sent"), "a write behind a read: {code:?} {said}");
    }
    let (code, said) = run(&["send", &unit, "01 08 00 04 00 00"]);
    assert!(code == Some(2) && said.contains("it answers nothing until sub-function 01"), "{code:?} {said}");
    let (code, said) = run(&["send", &unit, "01 2B 0D 00 00"]);
    assert!(code == Some(2) && said.contains("nothing was sent"), "CANopen may write: {code:?} {said}");
    let (code, said) = run(&["send", &unit, "--as-is", "55 55"]);
    assert!(code == Some(2) && said.contains("--yes"), "bytes that are no request may do anything: {code:?} {said}");
}

#[test]
fn send_fails_on_an_invalid_response_and_counts_its_bytes() {
    let garbage = peer(answers(|_| vec![0x55; 8_128]));
    for mode in ["tcp", "rtu-over-tcp"] {
        let (code, said) = run(&["send", &garbage, "--mode", mode, "--timeout", "100", "01 03 00 00 00 01"]);
        assert_eq!(code, Some(1), "{said}");
        assert!(!said.contains(" of 8 bytes"), "{said}");
    }
    // A refusal is an answer.
    let unit = peer(answers(|_| vec![0, 1, 0, 0, 0, 3, 1, 0x83, 2]));
    let (code, said) = run(&["send", &unit, "01 03 00 00 00 01"]);
    assert!(code == Some(0) && said.contains("illegal data address"), "{code:?} {said}");
}

#[test]
fn a_frame_with_a_wrong_check_ends_with_an_error() {
    let (code, said) = run(&["decode", "--rtu", "01 03 00 00 00 01 84 0B"]);
    assert!(code == Some(1) && said.contains("wrong: CRC error"), "{code:?} {said}");
    let (code, said) = run(&["decode", ":010300000001FC"]);
    assert!(code == Some(1) && said.contains("wrong: LRC error"), "{code:?} {said}");
}

#[test]
fn one_unit_that_talks_all_the_time_is_not_every_unit() {
    let chatter = |bytes: Vec<u8>| {
        peer(move |mut stream| {
            stream.set_nodelay(true).unwrap();
            while stream.write_all(&bytes).is_ok() {
                std::thread::yield_now();
            }
        })
    };
    for bytes in [vec![0x55; 64], with_crc(&[99, 3, 2, 0, 7])] {
        let address = chatter(bytes);
        let (code, said) = run(&["scan", &address, "--mode", "rtu-over-tcp", "--units", "1-20", "--timeout", "100"]);
        assert!(code == Some(1) && said.contains("no unit was found"), "{code:?} {said}");
        assert!(said.contains("20 addresses: something else talks on this line"), "{said}");
    }
}

#[test]
fn an_ipv6_address_is_understood() {
    let Ok(listener) = TcpListener::bind((Ipv6Addr::LOCALHOST, 0)) else { return };
    let address = listener.local_addr().unwrap().to_string();
    serve(listener, answers(|_| vec![0, 1, 0, 0, 0, 5, 1, 3, 2, 0, 7]));
    assert!(address.starts_with("[::1]:"));
    let (code, said) = run(&["probe", &address, "--read", "holding:0"]);
    assert!(code == Some(0) && said.contains(&format!("TCP {address}")), "{code:?} {said}");
}

#[test]
fn a_unit_that_answers_wrongly_is_not_called_silent() {
    let unit = peer(answers(|_| vec![0, 1, 0, 0, 0, 9, 1, 3, 6, 0, 7, 0, 7, 0, 7]));
    let (code, said) = run(&["probe", &unit, "--read", "holding:0:2"]);
    assert_eq!(code, Some(1));
    assert!(said.contains("answers, but wrongly: response with") && !said.contains("not responding"), "{said}");
    let silent = peer(std::mem::forget);
    let (code, said) = run(&["probe", &silent, "--timeout", "20"]);
    assert!(code == Some(1) && said.contains("the unit does not respond"), "{code:?} {said}");
}

#[test]
fn a_unit_that_cannot_answer_is_refused_before_a_port_is_opened() {
    for unit in ["0", "248"] {
        let (ended, said) = run(&["open", "/dev/no-such-port", "--unit", unit]);
        let words = format!("--unit: found {unit}, expected 1 to 247");
        assert!(ended == Some(2) && said.contains(&words), "{ended:?} {said}");
    }
}

#[test]
fn a_network_is_scanned_only_after_a_yes() {
    let device = TcpListener::bind((Ipv4Addr::new(127, 0, 0, 5), 0)).unwrap();
    let port = device.local_addr().unwrap().port();
    let Ok(closed) = TcpListener::bind((Ipv4Addr::new(127, 0, 0, 9), port)) else { return };
    serve(device, answers(|request| vec![request[0], request[1], 0, 0, 0, 5, request[6], 3, 2, 0, 7]));
    serve(closed, drop);
    let network = format!("127.0.0.0/24:{port}");
    let (code, said) = run(&["scan", &network]);
    assert!(code == Some(2) && said.contains("connects to every host") && said.contains("--yes"), "{code:?} {said}");
    let (code, said) = run(&["scan", &network, "--yes", "--timeout", "300"]);
    assert!(code == Some(0) && said.contains("1  127.0.0.5  unit 1: register 0 = 7"), "{code:?} {said}");
    assert!(said.contains("-  127.0.0.9  accepts connections") && !said.contains("127.0.0.6"), "{said}");
    let (code, said) = run(&["scan", "10.0.0.0/16", "--yes"]);
    assert!(code == Some(2) && said.contains("at most 256 addresses"), "{code:?} {said}");
}

#[test]
fn a_new_plant_is_not_asked_for_without_a_terminal() {
    let (code, said) = run(&["new"]);
    assert!(code == Some(2) && said.contains("asks questions: run it in a terminal"), "{code:?} {said}");
}

#[test]
fn a_mistyped_command_gets_a_suggestion() {
    for (typed, meant) in [("demoo", "demo"), ("atach", "attach"), ("staus", "status")] {
        let (code, said) = run(&[typed]);
        assert!(code == Some(2) && said.contains(&format!("`sightglass {meant}`")), "{code:?} {said}");
    }
    let (_, said) = run(&["no-such-plant-at-all"]);
    assert!(!said.contains("did you mean the command"), "{said}");
}

#[test]
fn a_plug_returns_every_byte() {
    if !have("socat", "socat") {
        return;
    }
    let folder = folder();
    let port = folder.path().join("plug");
    let end = format!("pty,raw,echo=0,link={}", port.display());
    let mut plug = Process::start(Command::new("socat").args(["-d", "-d", &end, "exec:cat"]));
    plug.wait_for("starting data transfer loop");
    let (code, said) = run(&["loopback", port.to_str().unwrap(), "--plug"]);
    let counted = "320 bytes sent, 320 received: 0 wrong, 0 missing, 0 more than sent; 0.0 % faults";
    assert!(code == Some(0) && said.contains(counted) && said.contains("local echo"), "{code:?} {said}");
    assert!(said.contains(" bytes a second"), "{said}");
    // In seven bits too.
    let (code, said) = run(&["loopback", port.to_str().unwrap(), "--plug", "--mode", "ascii", "--count", "6"]);
    assert!(code == Some(0) && said.contains("192 received: 0 wrong"), "{code:?} {said}");
    let (code, said) = run(&["loopback", "127.0.0.1:1", "--plug"]);
    assert!(code == Some(2) && said.contains("needs a serial line"), "{code:?} {said}");
}

#[test]
fn a_plug_has_no_unit() {
    let (code, said) = run(&["loopback", "/dev/ttyS99", "--plug", "--unit", "3"]);
    assert!(code == Some(2) && said.contains("'--plug' cannot be used with '--unit"), "{code:?} {said}");
}

#[test]
fn a_bad_plug_and_none_are_distinguished() {
    if !have("socat", "socat") {
        return;
    }
    let [nothing, bad] = [(); 2].map(|()| folder());
    let cable = Cable::plug(nothing.path());
    let port = cable.ends[0].to_str().unwrap();
    let (code, said) = run(&["loopback", port, "--plug", "--count", "2", "--timeout", "50"]);
    assert!(code == Some(1) && said.contains("64 bytes sent, 0 received: 0 wrong, 64 missing"), "{code:?} {said}");
    assert!(said.contains("nothing came back"), "{said}");
    // The other end of this one loses a byte of each pattern, and changes one.
    let cable = Cable::plug(bad.path());
    let port = cable.ends[0].to_str().unwrap();
    let mut other = OpenOptions::new().read(true).write(true).open(&cable.ends[1]).unwrap();
    std::thread::spawn(move || {
        let mut pattern = [0; 32];
        while other.read_exact(&mut pattern).is_ok() {
            pattern[3] ^= 0x10;
            if other.write_all(&pattern[..31]).is_err() {
                break;
            }
        }
    });
    let (code, said) = run(&["loopback", port, "--plug", "--count", "5"]);
    let counted = "160 bytes sent, 155 received: 5 wrong, 5 missing, 0 more than sent; 6.2 % faults";
    assert!(code == Some(1) && said.contains(counted), "{code:?} {said}");
}

#[test]
fn a_port_without_signals_says_so() {
    if !have("socat", "socat") {
        return;
    }
    let folder = folder();
    let cable = Cable::plug(folder.path());
    let (code, said) = run(&["signals", cable.ends[0].to_str().unwrap(), "--rts", "off"]);
    assert!(
        code == Some(1) && said.contains("this port has no RTS, DTR"),
        "what was asked is not done: {code:?} {said}"
    );
    let (code, said) = run(&["signals", cable.ends[0].to_str().unwrap()]);
    assert!(code == Some(0) && said.contains("this port has no RTS, DTR"), "{code:?} {said}");
    let (code, said) = run(&["signals", "127.0.0.1:502"]);
    assert!(code == Some(2) && said.contains("a serial port is needed"), "{code:?} {said}");
}

#[test]
fn what_standard_output_does_not_take_is_a_failure() {
    let full = || OpenOptions::new().write(true).open("/dev/full").unwrap();
    for args in
        [&["experiments", "--csv"][..], &["mimic", "tank"], &["profiles"], &["decode", "01 03 00 00 00 01 84 0A"]]
    {
        let output = sightglass().args(args).stdout(full()).output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{args:?}: {said}");
        assert!(said.contains("standard output: No space left on device"), "{args:?}: {said}");
    }
}

#[test]
fn a_walk_over_models_says_why_it_found_none() {
    // Nothing is there, and nothing is said.
    let closed = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap().local_addr().unwrap().to_string();
    let (code, said) = run(&["probe", &closed, "--sunspec"]);
    assert!(code == Some(1) && said.contains("refused") && !said.contains("SunSpec models at"), "{code:?} {said}");
    let silent = peer(answers(|_| Vec::new()));
    let (code, said) = run(&["probe", &silent, "--sunspec", "--timeout", "50"]);
    assert!(code == Some(1) && said.contains("response timeout") && said.contains("not known"), "{code:?} {said}");
    let refusing = peer(answers(|request| [&request[..4], &[0, 3, request[6], request[7] | 0x80, 2]].concat()));
    let (code, said) = run(&["probe", &refusing, "--sunspec"]);
    assert!(code == Some(1) && said.contains("has no SunSpec models"), "{code:?} {said}");
}
