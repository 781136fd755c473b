//! Reading one block: a unit that may be out of sync is resynchronised first; what came is taken apart.

use std::sync::Arc;

use jiff::Timestamp;

use crate::{
    bus::{
        codec,
        io::link::{Link, LinkError},
        late_reply::Proof,
        pdu,
        plan::Block,
    },
    plant::{event::Event, exact::Exact, fault::Fault, number::to_u16, tag::TagDef, tag_value::TagValue},
};

/// What came in between may have shown that the unit sends what it was not asked for.
fn check_in_sync(link: &mut Link, block: &Block) -> Result<(), LinkError> {
    if link.is_ambiguous(&block.request()) {
        return Err(Fault::OutOfSync.into());
    }
    link.proof_given(block.unit);
    Ok(())
}

/// Makes sure that the answer to a block cannot be mistaken for an outstanding one: by a read of another signature, part of this
/// block or of one of `blocks`, by a loopback, or by any answer after which nothing more comes; what fails gives way to the next. Else
/// by time.
async fn resynchronise(blocks: &[Block], link: &mut Link, block: &Block) -> Result<(), LinkError> {
    let unit = block.unit;
    if !link.is_ambiguous(&block.request()) {
        return Ok(());
    }
    if link.is_unsettled(unit) {
        return Err(Fault::OutOfSync.into());
    }
    let must_wait = link.must_wait(&block.request());
    if must_wait || link.settles_in(unit).is_some() {
        return if link.forget_outstanding(unit).is_none() { Ok(()) } else { Err(Fault::OutOfSync.into()) };
    }
    let proof = link.proof(unit);
    if proof == Proof::Part {
        let others = blocks.iter().filter(|other| other.device == block.device && *other != block);
        if let Some(probe) = link.outstanding(unit).probe(std::iter::once(block).chain(others)) {
            match link.exchange(&probe).await {
                Ok(_) => return check_in_sync(link, block),
                // The device does not read parts of a block, or this answers an older request: neither proves anything.
                Err(LinkError::Fault(Fault::Exception(_))) => {}
                Err(error) => return Err(try_another(link, unit, error)),
            }
        }
    }
    if proof != Proof::Silence {
        return match link.loopback(unit).await {
            Ok(()) => check_in_sync(link, block),
            Err(LinkError::Fault(_)) if link.forget_outstanding(unit).is_none() => Ok(()),
            Err(error) => Err(try_another(link, unit, error)),
        };
    }
    match link.exchange(&block.request()).await {
        Ok(_) | Err(LinkError::Fault(Fault::Exception(_))) => Err(Fault::OutOfSync.into()),
        Err(LinkError::Fault(_)) if link.forget_outstanding(unit).is_none() => Ok(()),
        Err(error) => Err(try_another(link, unit, error)),
    }
}

/// The unit gives no such proof, or no answer at all.
fn try_another(link: &mut Link, unit: u8, error: LinkError) -> LinkError {
    link.proof_failed(unit);
    error
}

/// Reads a block from a unit that is in sync: its words from its address on; bits are 0 or 1. A `corrupt` answer is asked for once more; it counts as outstanding, so the unit is
/// resynchronised before.
pub(super) async fn read_in_sync(
    blocks: &[Block],
    link: &mut Link,
    block: &Block,
    corrupt: &mut Option<Fault>,
) -> Result<Vec<u16>, LinkError> {
    resynchronise(blocks, link, block).await?;
    match read(link, block).await {
        Err(LinkError::Fault(fault)) if fault.is_corrupt() => {
            *corrupt = Some(fault);
            resynchronise(blocks, link, block).await?;
            let second = read(link, block).await;
            if let Some(last) = &mut link.last {
                Arc::make_mut(last).tries = 2;
            }
            second
        }
        other => other,
    }
}

async fn read(link: &mut Link, block: &Block) -> Result<Vec<u16>, LinkError> {
    let answer = link.exchange(&block.request()).await?;
    Ok(parse(block, &answer)?)
}

/// The values in a checked answer message.
pub(super) fn parse(block: &Block, answer: &[u8]) -> Result<Vec<u16>, Fault> {
    let words_read = |pdu| pdu::words_read(&block.request()[1..], pdu, block.address_words);
    let values = answer.get(1..).and_then(words_read);
    // The length was checked byte for byte before; kept so that no later change can turn a shift into a value.
    let wrong = Fault::WrongLength { got: to_u16(answer.len()), asked: block.count };
    values.map(|(.., words)| words).ok_or(wrong)
}

/// The words of a tag in those of a block.
fn own<'a>(tag: &TagDef, block: &Block, words: &'a [u16]) -> Option<&'a [u16]> {
    let offset = tag.point.address.checked_sub(block.address)?;
    let start = usize::from(offset) * usize::from(tag.point.kind.address_words());
    words.get(start..start + usize::from(tag.point.words()))
}

/// The text of a tag that holds text.
pub(super) fn text_of(tag: &TagDef, block: &Block, words: &[u16]) -> Option<Arc<str>> {
    tag.is_text().then_some(())?;
    codec::decode_text(tag.point, own(tag, block, words)?).map(Into::into)
}

/// What a tag holds, a number or a text.
pub(super) fn held_by(tag: &TagDef, block: &Block, words: &[u16]) -> Option<TagValue> {
    match tag.is_text() {
        true => text_of(tag, block, words).map(TagValue::Text),
        false => value_of(tag, block, words).map(TagValue::Number),
    }
}

/// The same as the last answer of the link, which brought nothing else.
pub(super) fn read_alone(link: &Link, tag: &TagDef, held: &TagValue, at: Timestamp) -> Event {
    let exchange = link.last.clone();
    let response_time = exchange.as_ref().and_then(|exchange| exchange.response_time).unwrap_or_default();
    let (values, texts) = match held {
        TagValue::Number(raw) => (vec![(tag.id, *raw)], Vec::new()),
        TagValue::Text(text) => (Vec::new(), vec![(tag.id, text.clone())]),
    };
    Event::Read { at, device: tag.device, values, texts, response_time, exchange }
}

pub(super) fn value_of(tag: &TagDef, block: &Block, words: &[u16]) -> Option<Exact> {
    codec::decode(tag.point, own(tag, block, words)?)
}
