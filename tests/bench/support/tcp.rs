//! A slave on TCP that answers everything that has come in one write.

use std::{
    io::{Read, Write},
    net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream},
    thread,
};

use sightglass::api::bus::frame::{Mbap, mbap};

/// Serves until the process ends, each client on a thread of its own.
pub struct TcpSlave;

impl TcpSlave {
    /// Serves on a free port of this machine.
    pub fn start() -> SocketAddr {
        TcpSlave::start_with(super::answer)
    }

    /// The same with other answers to messages of unit and PDU.
    pub fn start_with(answer: fn(&[u8]) -> Option<Vec<u8>>) -> SocketAddr {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        let address = listener.local_addr().unwrap();
        thread::spawn(move || {
            for client in listener.incoming().map_while(Result::ok) {
                thread::spawn(move || serve(client, answer));
            }
        });
        address
    }
}

/// Ends when the client leaves or sends what is no Modbus.
fn serve(mut client: TcpStream, answer: fn(&[u8]) -> Option<Vec<u8>>) -> std::io::Result<()> {
    client.set_nodelay(true)?;
    let (mut piece, mut heard, mut said) = (vec![0; 1 << 16], Vec::new(), Vec::new());
    loop {
        match client.read(&mut piece)? {
            0 => return Ok(()),
            count => heard.extend_from_slice(&piece[..count]),
        }
        let mut start = 0;
        while let Mbap::Whole { end, .. } = mbap(&heard[start..]) {
            let frame = &heard[start..start + end];
            if let Some(answer) = answer(&frame[6..]) {
                said.extend_from_slice(&frame[..4]);
                said.extend_from_slice(&(answer.len() as u16).to_be_bytes());
                said.extend_from_slice(&answer);
            }
            start += end;
        }
        if mbap(&heard[start..]) == Mbap::Broken {
            return Ok(());
        }
        heard.drain(..start);
        client.write_all(&said)?;
        said.clear();
    }
}
