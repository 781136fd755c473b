//! What a device says of itself: report server id (11) and device identification (2B/0E).

use crate::plant::fault::ExceptionCode;
use crate::{bus::pdu::MEI_IDENTIFICATION, plant::number::to_u8};

/// Basic and regular objects, as a stream and one by one; with those of the maker's own.
const CONFORMITY: [u8; 2] = [0x82, 0x83];
/// The first object of a maker's own.
const EXTENDED: u8 = 0x80;
/// Room for objects: a PDU of 253 bytes less function, type, code, conformity, more, next and count.
const ROOM: usize = 253 - 7;

/// Name plate of a device.
#[derive(Debug, Clone)]
pub struct Identity {
    /// For function 11.
    pub server_id: u8,
    /// Object id and text, ascending: 00 vendor, 01 product code, 02 revision, 03 URL, 04 product, 05 model, 06 application
    /// (V1.1b3, 6.21). Each text fits into one answer.
    pub objects: Vec<(u8, String)>,
}

/// Answer to function 11: the id, the run lamp, the name of the product.
pub(super) fn report(identity: &Identity, running: bool) -> Vec<u8> {
    let name = identity.objects.iter().find(|(id, _)| *id == 0x01).map_or("", |(_, text)| text.as_str());
    let mut reply = vec![0x11, 2 + to_u8(name.len()), identity.server_id, if running { 0xFF } else { 0x00 }];
    reply.extend_from_slice(name.as_bytes());
    reply
}

/// Answer to function 2B/0E. Codes 1 to 3 stream the basic, regular or all objects from one on (from the first if there
/// is no such object; what goes beyond our conformity is answered as far as it goes), code 4 reads one.
pub(super) fn read(identity: &Identity, code: u8, from: u8) -> Result<Vec<u8>, ExceptionCode> {
    let is_extended = identity.objects.iter().any(|(id, _)| EXTENDED <= *id);
    let conformity = CONFORMITY[usize::from(is_extended)];
    let last = match code {
        1 => 0x02,
        2 => EXTENDED - 1,
        3 => u8::MAX,
        4 => {
            let one = identity.objects.iter().find(|(id, _)| *id == from).ok_or(ExceptionCode::ILLEGAL_ADDRESS)?;
            return Ok(message((code, conformity), None, std::slice::from_ref(one)));
        }
        _ => return Err(ExceptionCode::ILLEGAL_VALUE),
    };
    let count = identity.objects.iter().take_while(|(id, _)| *id <= last).count();
    let wanted = &identity.objects[..count];
    let rest = &wanted[wanted.iter().position(|(id, _)| *id == from).unwrap_or(0)..];
    let ends = rest.iter().scan(0, |end, (_, text)| {
        *end += 2 + text.len();
        Some(*end)
    });
    let fitting = ends.take_while(|end| *end <= ROOM).count();
    Ok(message((code, conformity), rest.get(fitting).map(|(id, _)| *id), &rest[..fitting]))
}

fn message((code, conformity): (u8, u8), next: Option<u8>, objects: &[(u8, String)]) -> Vec<u8> {
    let more = if next.is_some() { 0xFF } else { 0x00 };
    let mut reply = vec![0x2B, MEI_IDENTIFICATION, code, conformity, more, next.unwrap_or(0), to_u8(objects.len())];
    for (id, text) in objects {
        reply.extend_from_slice(&[*id, to_u8(text.len())]);
        reply.extend_from_slice(text.as_bytes());
    }
    reply
}

#[cfg(test)]
mod tests {
    use crate::sim::dl06::Dl06;
    use crate::sim::pdu::{Registers, serve};

    /// The object ids of an answer, and with which one the next begins.
    fn check(code: u8, from: u8, ids: &[u8], next: Option<u8>) {
        let reply = serve(&mut Dl06::new(), &[0x2B, 0x0E, code, from]).expect("an answer");
        assert!(reply.len() <= 253);
        let [0x2B, 0x0E, answered, 0x82, more, after, count, ref objects @ ..] = reply[..] else {
            panic!("{reply:02X?}")
        };
        assert_eq!((answered, usize::from(count)), (code, ids.len()));
        assert_eq!((more, after), next.map_or((0, 0), |next| (0xFF, next)));
        let (mut rest, mut seen) = (objects, Vec::new());
        while let [id, length, tail @ ..] = rest {
            let (text, tail) = tail.split_at(usize::from(*length));
            let own = Dl06::new().identity().objects;
            let known = own.iter().find(|(known, _)| known == id).map(|(_, text)| text.as_bytes());
            assert_eq!(known, Some(text));
            seen.push(*id);
            rest = tail;
        }
        assert_eq!(seen, ids);
    }

    #[test]
    fn a_device_names_itself_in_pieces_that_fit() {
        check(1, 0, &[0, 1, 2], None);
        check(1, 2, &[2], None);
        check(1, 5, &[0, 1, 2], None);
        check(2, 0, &[0, 1, 2, 3, 4, 5], Some(6));
        check(2, 6, &[6], None);
        check(2, 0x40, &[0, 1, 2, 3, 4, 5], Some(6));
        check(3, 4, &[4, 5], Some(6));
        check(3, 5, &[5, 6], None);
        check(4, 4, &[4], None);
    }

    #[test]
    fn what_it_does_not_have_it_refuses() {
        let refused = |request: &[u8], code| {
            assert_eq!(serve(&mut Dl06::new(), request), Some(vec![0xAB, code]), "{request:02X?}");
        };
        refused(&[0x2B, 0x0E, 4, 9], 2);
        refused(&[0x2B, 0x0E, 0, 0], 3);
        refused(&[0x2B, 0x0E, 5, 0], 3);
        refused(&[0x2B, 0x0E, 1], 3);
        refused(&[0x2B, 0x0D, 0, 0], 1);
    }

    #[test]
    fn the_run_lamp_is_in_the_server_id() {
        let plc = &mut Dl06::new();
        let report = |lamp| [&[0x11, 10, 6, lamp], &b"D0-06DD1"[..]].concat();
        assert_eq!(serve(plc, &[0x11]), Some(report(0)));
        plc.start();
        assert_eq!(serve(plc, &[0x11]), Some(report(0xFF)));
        assert_eq!(serve(plc, &[7]), Some(vec![7, 0b11]));
    }
}
