//! The keys of a `[[line]]`, by its mode.

use crate::{
    plant::{
        def::{Parity, Rs485},
        keyword::keyword_enum,
    },
    profile::reader::toml_tables,
};

keyword_enum! {
    /// How the master of a listening line frames its messages: the modes of a line that is polled.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub enum ListenFraming: "framing" {
        Rtu => "rtu",
        Ascii => "ascii",
        Tcp => "tcp",
        RtuOverTcp => "rtu-over-tcp",
        AsciiOverTcp => "ascii-over-tcp",
    }
}

toml_tables! {
    /// A `[[line]]` on a serial port.
    SerialTable, "a line on a serial port" {
        need "name" name: String,
        need "mode" mode: String,
        need "port" port: String,
        need "baud" baud: u32,
        opt "data_bits" data_bits: u8,
        need "parity" parity: Parity,
        opt "stop_bits" stop_bits: u8,
        opt "rs485" rs485: Rs485,
        opt "timeout_ms" timeout_ms: u16,
        opt "request_gap_ms" request_gap_ms: u16,
        opt "frame_timeout_ms" frame_timeout_ms: u16,
        opt "turnaround_ms" turnaround_ms: u16,
    }

    /// A `[[line]]` over TCP.
    TcpTable, "a line over TCP" {
        need "name" name: String,
        need "mode" mode: String,
        need "host" host: String,
        opt "tcp_port" tcp_port: u16,
        opt "timeout_ms" timeout_ms: u16,
        opt "request_gap_ms" request_gap_ms: u16,
        opt "frame_timeout_ms" frame_timeout_ms: u16,
        opt "connect_delay_ms" connect_delay_ms: u16,
    }

    /// A `[[line]]` with a host that takes datagrams.
    UdpTable, "a line over UDP" {
        need "name" name: String,
        need "mode" mode: String,
        need "host" host: String,
        opt "udp_port" udp_port: u16,
        opt "timeout_ms" timeout_ms: u16,
        opt "request_gap_ms" request_gap_ms: u16,
        opt "frame_timeout_ms" frame_timeout_ms: u16,
    }

    /// A `[[line]]` of another master on a serial port, which is read only.
    ListenSerialTable, "a listening line on a serial port" {
        need "name" name: String,
        need "mode" mode: String,
        /// How the other master frames its messages.
        opt "framing" framing: ListenFraming,
        need "port" port: String,
        need "baud" baud: u32,
        opt "data_bits" data_bits: u8,
        need "parity" parity: Parity,
        opt "stop_bits" stop_bits: u8,
        /// Silence that ends what is no whole frame.
        opt "frame_timeout_ms" frame_timeout_ms: u16,
    }

    /// A `[[line]]` of another master, whose bytes of both sides a TCP port forwards (a mirror).
    ListenTcpTable, "a listening line over TCP" {
        need "name" name: String,
        need "mode" mode: String,
        /// How the other master frames its messages.
        opt "framing" framing: ListenFraming,
        need "host" host: String,
        opt "tcp_port" tcp_port: u16,
        /// Silence that ends what is no whole frame.
        opt "frame_timeout_ms" frame_timeout_ms: u16,
    }
}
