//! What `sightglass open` begins with: what is watched, and where it is logged.

use super::{Named, Registers, WATCHED_MAX, Watched, named};
use crate::{
    plant::{
        live::AddressSpan,
        tag::{ByteOrder, DataType},
    },
    t,
    ui::{msg::Start, tabs::prelude::*},
};

/// Reads `NAME=ADDRESS[:COUNT] [TYPE] [ORDER] [SCALE] [UNIT]`, with blanks or commas between: `SV=41003 int16 0.1 °C`.
/// COUNT values stand one behind the other, and are called NAME1, NAME2 and so on.
pub fn parse(text: &str) -> Result<Vec<Named>, String> {
    let form = || t!("found `{text}`, expected NAME=ADDRESS[:COUNT] [TYPE] [ORDER] [SCALE] [UNIT]", text);
    let (name, rest) = text.split_once('=').ok_or_else(form)?;
    let name = name.trim();
    let mut words = rest.split([' ', ',']).filter(|word| !word.is_empty());
    let place = words.next().filter(|_| !name.is_empty()).ok_or_else(form)?;
    let AddressSpan { table, address, count } = place.parse()?;
    let kind = if table.is_bits() { DataType::Bool } else { DataType::U16 };
    let plain = Named::new(table, address, kind, ByteOrder::Abcd, name);
    let words: Vec<&str> = std::iter::once("name").chain(words).collect();
    let first = Named { name: name.to_owned(), ..named(&words.join(" "), plain)? };
    let one = |n: u16| {
        let address = u32::from(address) + u32::from(n) * u32::from(first.count());
        let wrong = || t!("{name}: address {address}: the last is 65535", name, address);
        let end = address + u32::from(first.count());
        let place = u16::try_from(address).ok().filter(|_| end <= 0x1_0000).ok_or_else(wrong)?;
        let name = if count == 1 { name.to_owned() } else { format!("{name}{}", n + 1) };
        Ok(Named { name, address: place, ..first.clone() })
    };
    (0..count).map(one).collect()
}

/// Reads several, which must be registers of their own, with names of their own, and not too many.
pub fn parse_all(texts: &[String]) -> Result<Vec<Named>, String> {
    let mut all: Vec<Named> = Vec::new();
    for text in texts {
        for named in parse(text)? {
            let same =
                |old: &&Named| (old.table, old.address) == (named.table, named.address) || old.name == named.name;
            if let Some(old) = all.iter().find(same) {
                let (old, place) = (&old.name, named.table.modicon(named.address));
                return Err(t!("{name} at {place}: {old} has this name or address", name = named.name, place, old));
            }
            all.push(named);
        }
    }
    if WATCHED_MAX < all.len() {
        return Err(t!("found {count} registers, expected at most {most}", count = all.len(), most = WATCHED_MAX));
    }
    Ok(all)
}

impl Registers {
    /// Is a log under way?
    pub fn is_logging(&self) -> bool {
        self.watch.is_logging()
    }

    /// Watches and logs from the first read on.
    pub fn begin(&mut self, cx: &ViewContext, start: Start) -> Vec<UiAction> {
        let Start { watch, log, every, shown } = start;
        if let Some((file, shown)) = shown {
            self.show_log(cx, &file, shown);
            return Vec::new();
        }
        self.period = every.unwrap_or(self.period);
        if let Some(first) = watch.first() {
            (self.table, self.first, self.selected) = (first.table, first.address, first.address);
        }
        for named in watch {
            self.watch.items.push(Watched::new((named.table, named.address)));
            self.names.put(named);
        }
        let mut actions = log.map_or(Vec::new(), |path| self.begin_log(path));
        actions.extend(self.read_now(cx));
        actions
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::tag::Table;

    #[test]
    fn a_watched_register_is_written_in_one_word_or_more() {
        let one = |text: &str| parse(text).map(|mut all| all.remove(0));
        let sv = one("SV=41003 int16 0.1 °C").expect("a register");
        assert_eq!(
            (sv.table, sv.address, sv.kind, sv.scale, sv.unit.as_str()),
            (Table::Holding, 1002, DataType::I16, 0.1, "°C")
        );
        let flow = one("flow 1=input:0x3F4,float32,CDAB,m³/h").expect("a register");
        assert_eq!(
            (flow.name.as_str(), flow.table, flow.address, flow.order),
            ("flow 1", Table::Input, 1012, ByteOrder::Cdab)
        );
        let places =
            |text: &str| parse(text).map(|all| all.into_iter().map(|one| (one.name, one.address)).collect::<Vec<_>>());
        assert_eq!(places("T=41003:2 int32"), Ok(vec![("T1".into(), 1002), ("T2".into(), 1004)]));
        for wrong in ["SV", "=41003", "SV=", "SV=5", "SV=41003 int16 a b", "run=1:2:3", "T=465535:2 int32"] {
            let why = parse(wrong).expect_err(wrong);
            assert!(why.contains("expected") || why.contains("65535"), "{wrong}: {why}");
        }
        let all = |texts: &[&str]| parse_all(&texts.iter().map(|text| (*text).to_owned()).collect::<Vec<_>>());
        assert!(all(&["a=40001", "b=40001"]).is_err() && all(&["a=40001", "a=40002"]).is_err());
        assert!(all(&["a=40001:33"]).is_err_and(|why| why.contains("found 33")));
    }
}
