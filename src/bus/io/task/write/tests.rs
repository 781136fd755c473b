//! The request of each kind of tag.

use super::*;
use crate::plant::{
    def::{DeviceId, TagId},
    tag::{ByteOrder, DataType, Point},
};

fn request(kind: DataType, field: Option<(u8, u8)>, write_fc: Option<u8>, raw: f64) -> Option<Pdu> {
    let point = Point { table: Table::Holding, address: 100, kind, order: ByteOrder::Abcd, field };
    write_request(&TagDef { write_fc, ..TagDef::new(TagId(0), DeviceId(0), "D.T", point) }, raw.into())
}

#[test]
fn each_tag_is_written_by_the_function_that_its_device_has() {
    let one = Pdu::write_register(100, 7);
    assert_eq!(request(DataType::U16, None, None, 7.0), Some(one.clone()));
    assert_eq!(request(DataType::U16, None, Some(6), 7.0), Some(one));
    let many = |words: &[u16]| Pdu::write_registers(100, words);
    assert_eq!(request(DataType::U16, None, Some(16), 7.0), Some(many(&[7])));
    assert_eq!(request(DataType::U32, None, None, 65_537.0), Some(many(&[1, 1])));
    let both = Pdu::write_and_read(100, &[7]);
    assert_eq!(request(DataType::U16, None, Some(23), 7.0), Some(both));
    let masked = Pdu::mask_write(100, 0xFFCF, 0x0020);
    assert_eq!(request(DataType::U16, Some((4, 2)), Some(22), 2.0), Some(masked));
    assert_eq!(request(DataType::U16, None, None, 65_536.0), None, "what does not fit is not sent");
}

#[test]
fn a_tag_is_written_where_its_device_takes_it() {
    let read = Point { table: Table::Input, address: 100, kind: DataType::U32, order: ByteOrder::Cdab, field: None };
    let tag = TagDef { write_at: Some((Table::Holding, 7)), ..TagDef::new(TagId(0), DeviceId(0), "D.T", read) };
    let sent = Pdu::write_registers(7, &[1, 2]);
    assert_eq!(write_request(&tag, Exact::plain(131_073.0)), Some(sent));
    assert_eq!(write_request(&TagDef { write_at: None, ..tag }, Exact::plain(1.0)), None, "it is only read there");
}

#[test]
fn coils_are_written_one_by_one_by_default() {
    let point = Point { table: Table::Coil, address: 5, kind: DataType::Bool, order: ByteOrder::Abcd, field: None };
    let coil = TagDef::new(TagId(0), DeviceId(0), "D.C", point);
    assert_eq!(write_request(&coil, Exact::plain(1.0)), Some(Pdu::write_coil(5, true)));
    let fifteen = TagDef { write_fc: Some(15), ..coil };
    assert_eq!(write_request(&fifteen, Exact::plain(0.0)), Some(Pdu::write_coils(5, &[0])));
    let input = TagDef { point: Point { table: Table::Discrete, ..point }, write_fc: None, ..fifteen };
    assert_eq!(write_request(&input, Exact::plain(1.0)), None);
    let five = TagDef { write_fc: Some(5), ..input };
    assert_eq!(write_request(&five, Exact::plain(1.0)), Some(Pdu::write_coil(5, true)));
}
