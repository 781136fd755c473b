//! A field of bits, or one byte, that is written with the whole register: read, set, written back.

use super::Task;
use crate::{
    bus::{
        codec,
        io::link::{Link, LinkError},
        pdu::Pdu,
        plan,
    },
    plant::{event::WriteResult, exact::Exact, fault::Fault, line_trouble::LineTrouble, tag::TagDef},
};

impl Task<'_> {
    /// The request that writes the registers as they are read right before it, with the number of a tag set. Without a valid
    /// reading nothing is written: the inner `Err` is then the result of the write. The outer one: the port closed.
    pub(super) async fn modified(
        &mut self,
        link: &mut Link,
        tag: &TagDef,
        raw: Exact,
    ) -> Result<Result<Pdu, WriteResult>, LineTrouble> {
        let def = self.def.clone();
        let block = plan::single(def.device(tag.device), tag);
        let held = match self.read_unless_stopped(link, &block, None).await {
            Some(Ok(words)) => words,
            Some(Err(LinkError::Fault(fault))) => return Ok(Err(WriteResult::NotSent(fault))),
            Some(Err(LinkError::Gone(why))) => return Err(why),
            None => return Ok(Err(WriteResult::Superseded)),
        };
        // A block may begin before the tag where the device wants it so.
        let first = usize::from(tag.point.address - block.address);
        let own = held.get(first..first + usize::from(tag.point.len()));
        let words = own.and_then(|own| codec::modified(tag.point, own, raw));
        Ok(words.map(|words| request(tag, &words)).ok_or(WriteResult::NotSent(Fault::NotANumber)))
    }
}

fn request(tag: &TagDef, words: &[u16]) -> Pdu {
    match (words, tag.write_fc) {
        ([word], None | Some(6)) => Pdu::write_register(tag.point.address, *word),
        _ => Pdu::write_registers(tag.point.address, words),
    }
}
