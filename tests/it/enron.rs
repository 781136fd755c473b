//! A flow computer that counts as Enron and Daniel do: 32 bits in one address, read and written in one count each.

use std::{
    collections::BTreeMap,
    io::{Read, Write},
    net::{Ipv4Addr, TcpListener, TcpStream},
    sync::{Arc, Mutex},
    thread::spawn,
};

use crate::one_device::OneDevice;

/// Its map in `[first, behind the last)`; 3xxx are words of 16 bits.
const WIDE: [(u16, u16); 2] = [(5_001, 6_000), (7_001, 8_000)];

fn is_wide(address: u16) -> bool {
    WIDE.iter().any(|(first, end)| (*first..*end).contains(&address))
}

/// The numbers of all its addresses by rule, and each request that came.
type Held = Arc<Mutex<(BTreeMap<u16, u32>, Vec<Vec<u8>>)>>;

/// Function 3 with four bytes for each address above 5000, function 16 likewise; everything else is refused.
fn answer(held: &Held, pdu: &[u8]) -> Vec<u8> {
    let (cells, seen) = &mut *held.lock().unwrap();
    seen.push(pdu.to_vec());
    let (first, count) = (u16::from_be_bytes([pdu[1], pdu[2]]), u16::from_be_bytes([pdu[3], pdu[4]]));
    let end = first + count;
    let size = if is_wide(first) { 4 } else { 2 };
    // No read goes over the end of a range.
    if (first..end).any(|at| is_wide(at) != is_wide(first)) {
        return vec![pdu[0] | 0x80, 2];
    }
    match pdu[0] {
        3 if usize::from(count) * size <= 250 => {
            let bytes =
                (first..end).flat_map(|at| cells.get(&at).copied().unwrap_or(0).to_be_bytes()[4 - size..].to_vec());
            [3, (usize::from(count) * size) as u8].into_iter().chain(bytes).collect()
        }
        16 if usize::from(pdu[5]) == usize::from(count) * size => {
            let number = |bytes: &[u8]| bytes.iter().fold(0, |number, byte| number << 8 | u32::from(*byte));
            cells.extend((first..).zip(pdu[6..].chunks(size).map(number)));
            pdu[..5].to_vec()
        }
        3 | 16 => vec![pdu[0] | 0x80, 3],
        other => vec![other | 0x80, 1],
    }
}

fn serve(mut stream: TcpStream, held: &Held) {
    let mut head = [0; 7];
    while stream.read_exact(&mut head).is_ok() {
        let mut pdu = vec![0; usize::from(head[5]) - 1];
        stream.read_exact(&mut pdu).unwrap();
        let answer = answer(held, &pdu);
        head[5] = answer.len() as u8 + 1;
        if stream.write_all(&[&head[..], &answer].concat()).is_err() {
            break;
        }
    }
}

const MAP: &str = r#"
vendor = "A"
model = "Flow computer"
status = "manual"
source = "Test"
functions = [3, 16]
tag = [
    { name = "STATE", table = "holding", address = 3001, type = "uint16" },
    { name = "PULSES", table = "holding", address = 5001, type = "enron_uint32", access = "rw" },
    { name = "NET", table = "holding", address = 5004, type = "enron_int32" },
    { name = "FLOW", table = "holding", address = 7001, type = "enron_float32", decimals = 2, unit = "m³/h" },
    { name = "K", table = "holding", address = 7002, type = "enron_float32", access = "rw", decimals = 3, min = 0, max = 2000 },
]
"#;

const SHOWN: [(&str, &str); 5] =
    [("FC.STATE", "7"), ("FC.PULSES", "305419896"), ("FC.NET", "-2"), ("FC.FLOW", "230.20"), ("FC.K", "1.000")];

#[test]
fn a_flow_computer_of_32_bits_an_address_is_read_and_written() {
    let values = [(3_001, 7), (5_001, 0x1234_5678), (5_004, -2_i32 as u32), (7_001, 230.2_f32.to_bits())];
    let cells = values.into_iter().chain([(7_002, 1_f32.to_bits())]).collect();
    let held: Held = Arc::new(Mutex::new((cells, Vec::new())));
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let port = listener.local_addr().unwrap().port();
    let served = held.clone();
    spawn(move || listener.incoming().flatten().for_each(|stream| serve(stream, &served)));

    let mut plant = OneDevice::start("FC", MAP, port);
    let said = |args: &[&str]| plant.said(args);
    let good = |state: &serde_json::Value| {
        let tags = state["tags"].as_array().cloned().unwrap_or_default();
        tags.iter().filter(|tag| tag["quality"] == "good").count() == SHOWN.len()
    };
    let states = (0..500).map(|_| serde_json::from_str(&said(&["status", "--json"]).1).unwrap());
    let state: serde_json::Value = states.into_iter().find(good).expect("all values are good");
    for (name, shown) in SHOWN {
        let tag = state["tags"].as_array().unwrap().iter().find(|tag| tag["name"] == name).unwrap();
        assert_eq!(tag["text"], shown, "{name}");
    }

    for (tag, value, words) in [
        ("FC.K", "998.5", "1.000 → 998.500 : verified"),
        ("FC.PULSES", "4000000000", "305419896 → 4000000000 : verified"),
        ("FC.K", "2001", "outside range 0.000 … 2000.000"),
    ] {
        let (_, answer) = said(&["write", tag, value, "--yes"]);
        assert!(answer.contains(words), "{tag} {value}: {answer}");
    }
    plant.stop();
    let (cells, seen) = &*held.lock().unwrap();
    assert_eq!((f32::from_bits(cells[&7_002]), cells[&5_001]), (998.5, 4_000_000_000));
    let writes: Vec<&[u8]> = seen.iter().filter(|pdu| pdu[0] != 3).map(Vec::as_slice).collect();
    assert_eq!(writes[0], [16, 0x1B, 0x5A, 0, 1, 4, 0x44, 0x79, 0xA0, 0x00]);
    assert_eq!(writes[1..], [[16, 0x13, 0x89, 0, 1, 4, 0xEE, 0x6B, 0x28, 0x00]]);
    assert!(seen.contains(&vec![3, 0x13, 0x89, 0, 4]), "the gap is read over in one request: {seen:02X?}");
}
