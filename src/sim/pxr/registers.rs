//! The registers of the PXR4: two areas, limits, and what a write sets off.

use super::Pxr;
use super::map::{self, Meaning, Row};
use crate::{
    plant::def::Limits,
    sim::pdu::{Bits, Refusal, Registers, Words},
};

/// The functions are those that its manual and working drivers name, so it cannot be asked who it is.
impl Registers for Pxr {
    fn functions(&self) -> &[u8] {
        &[0x03, 0x04, 0x06, 0x10]
    }

    fn limits(&self) -> Limits {
        Limits { read_words_max: 60, write_words_max: 60, ..Limits::STANDARD }
    }

    fn bit(&self, _: Bits, _: u16) -> Result<bool, Refusal> {
        Err(Refusal::Function)
    }

    fn write_bit(&mut self, _: u16, _: bool) -> Result<(), Refusal> {
        Err(Refusal::Function)
    }

    /// Places between the known settings read as 0, as in the sibling series.
    fn word(&self, kind: Words, address: u16) -> Result<u16, Refusal> {
        let (area, place) = area(address)?;
        let (raw, meaning) = match kind {
            Words::Input => self.measurement(place)?,
            Words::Holding => (self.settings[place], map::row(place).map_or(Meaning::Plain, |row| row.meaning)),
        };
        Ok(if area == Area::Internal { self.to_internal(raw, meaning) } else { raw } as u16)
    }

    fn write_word(&mut self, address: u16, value: u16) -> Result<(), Refusal> {
        let (row, value) = self.target(address, value)?;
        let (min, max) = self.limits(row);
        if !(min..=max).contains(&value) {
            return Err(Refusal::Value);
        }
        let place = usize::from(row.place);
        self.settings[place] = value;
        match place {
            map::FIX => self.save(),
            map::SV_LOW | map::SV_HIGH => {
                let (low, high) = (self.settings[map::SV_LOW], self.settings[map::SV_HIGH]);
                self.settings[map::SV] = self.settings[map::SV].clamp(low, high);
            }
            _ => {}
        }
        Ok(())
    }
}

impl Pxr {
    /// Carries out a request to save; commands themselves are not saved.
    fn save(&mut self) {
        if std::mem::take(&mut self.settings[map::FIX]) == 1 {
            self.saved = self.settings;
            self.saved[map::TUNE] = 0;
            self.saved[map::PROGRAM] = 0;
            self.saves = self.saves.saturating_add(1);
        }
    }

    /// The measurements 31001–31010 with their meanings, which decide the number in the internal area.
    fn measurement(&self, place: usize) -> Result<(i16, Meaning), Refusal> {
        let tenths = |value: f64| (value * 10.0).round() as i16;
        Ok(match place {
            0 => (tenths(self.pv_c), Meaning::Temperature),
            1 => (tenths(self.sv_c), Meaning::Temperature),
            2 => (tenths(self.sv_c) - tenths(self.pv_c), Meaning::Difference),
            3 => ((self.mv_percent * 100.0).round() as i16, Meaning::Plain),
            4 => (0, Meaning::Plain),
            5 => (1, Meaning::Plain),
            6 => (i16::from(self.alarm), Meaning::Plain),
            7 => (self.faults as i16, Meaning::Plain),
            8 => (self.program.position() as i16, Meaning::Plain),
            9 => (tenths(self.heater_a), Meaning::Plain),
            _ => return Err(Refusal::Address),
        })
    }

    /// From display units to 0.01 % of full scale, which is what the internal area holds.
    fn to_internal(&self, raw: i16, meaning: Meaning) -> i16 {
        let (low, span) = self.scale();
        match meaning {
            Meaning::Temperature => ((f64::from(raw) - low) / span * 10_000.0).round() as i16,
            Meaning::Difference => (f64::from(raw) / span * 10_000.0).round() as i16,
            Meaning::Plain => raw,
        }
    }

    fn to_display(&self, raw: i16, meaning: Meaning) -> i16 {
        let (low, span) = self.scale();
        match meaning {
            Meaning::Temperature => (f64::from(raw) / 10_000.0 * span + low).round() as i16,
            Meaning::Difference => (f64::from(raw) / 10_000.0 * span).round() as i16,
            Meaning::Plain => raw,
        }
    }

    fn scale(&self) -> (f64, f64) {
        let low = f64::from(self.settings[map::RANGE_LOW]);
        (low, f64::from(self.settings[map::RANGE_HIGH]) - low)
    }

    /// The limits of a row now: those of SV are settings themselves.
    fn limits(&self, row: &Row) -> (i16, i16) {
        match usize::from(row.place) {
            map::SV | map::STEP_SV..map::STEP_TIMES => (self.settings[map::SV_LOW], self.settings[map::SV_HIGH]),
            map::SV_LOW => (self.settings[map::RANGE_LOW], self.settings[map::SV_HIGH]),
            map::SV_HIGH => (self.settings[map::SV_LOW], self.settings[map::RANGE_HIGH]),
            _ => (row.min, row.max),
        }
    }

    /// What a write means: the row and the value in display units.
    fn target(&self, address: u16, value: u16) -> Result<(&'static Row, i16), Refusal> {
        let (area, place) = area(address)?;
        let row = map::row(place).ok_or(Refusal::Address)?;
        let raw = value as i16;
        Ok((row, if area == Area::Internal { self.to_display(raw, row.meaning) } else { raw }))
    }
}

/// The two copies of every word (manual of the sibling series): engineering = internal + 1000.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Area {
    Internal,
    Engineering,
}

fn area(address: u16) -> Result<(Area, usize), Refusal> {
    match usize::from(address) {
        place @ 0..map::COUNT => Ok((Area::Internal, place)),
        place if (1000..1000 + map::COUNT).contains(&place) => Ok((Area::Engineering, place - 1000)),
        _ => Err(Refusal::Address),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::pdu::serve;

    fn check(pxr: &mut Pxr, request: &[u8], expect: &[u8]) {
        assert_eq!(serve(pxr, request).as_deref(), Some(expect), "request {request:02X?}");
    }

    #[test]
    fn a_set_value_is_taken_within_its_limits_only() {
        let pxr = &mut Pxr::new(27.0);
        check(pxr, &[3, 0x03, 0xEA, 0, 1], &[3, 2, 0x02, 0xBC]);
        check(pxr, &[6, 0x03, 0xEA, 0x04, 0xB0], &[6, 0x03, 0xEA, 0x04, 0xB0]);
        check(pxr, &[6, 0x03, 0xEA, 0x04, 0xB1], &[0x86, 3]);
        check(pxr, &[6, 0x03, 0xEA, 0xFF, 0xFF], &[0x86, 3]);
        // A lower upper limit pulls SV down with it.
        check(pxr, &[6, 0x04, 0x07, 0x01, 0xF4], &[6, 0x04, 0x07, 0x01, 0xF4]);
        check(pxr, &[3, 0x03, 0xEA, 0, 1], &[3, 2, 0x01, 0xF4]);
        // The lower limit cannot pass the upper one.
        check(pxr, &[6, 0x04, 0x06, 0x01, 0xF5], &[0x86, 3]);
        // Nor can both change places in one block.
        check(pxr, &[16, 0x04, 0x06, 0, 2, 4, 0x01, 0xF4, 0, 100], &[0x90, 3]);
        check(pxr, &[3, 0x04, 0x06, 0, 2], &[3, 4, 0, 0, 0x01, 0xF4]);
    }

    #[test]
    fn the_internal_area_holds_the_same_in_shares_of_full_scale() {
        let pxr = &mut Pxr::new(92.5);
        check(pxr, &[4, 0, 0, 0, 1], &[4, 2, 0x13, 0x88]);
        check(pxr, &[3, 0, 2, 0, 1], &[3, 2, 0x0E, 0xC8]);
        check(pxr, &[6, 0, 2, 0x0F, 0xA0], &[6, 0, 2, 0x0F, 0xA0]);
        check(pxr, &[3, 0x03, 0xEA, 0, 1], &[3, 2, 0x02, 0xE4]);
        check(pxr, &[3, 0, 5, 0, 1], &[3, 2, 0, 50]);
    }

    #[test]
    fn what_the_controller_cannot_do_it_refuses() {
        let pxr = &mut Pxr::new(27.0);
        check(pxr, &[1, 0, 0, 0, 1], &[0x81, 1]);
        check(pxr, &[5, 0, 0, 0xFF, 0], &[0x85, 1]);
        check(pxr, &[4, 0x03, 0xF2, 0, 1], &[0x84, 2]);
        check(pxr, &[3, 0x04, 0x3B, 0, 1], &[0x83, 2]);
        check(pxr, &[6, 0x03, 0xF3, 0, 1], &[0x86, 2]);
        check(pxr, &[3, 0x03, 0xE8, 0, 61], &[0x83, 3]);
        check(pxr, &[6, 0x03, 0xFB, 0, 0], &[0x86, 3]);
        check(pxr, &[6, 0x04, 0x39, 0, 3], &[0x86, 3]);
    }

    #[test]
    fn reserved_places_read_as_zero_within_a_block() {
        let mut pxr = Pxr::new(27.0);
        let reply = serve(&mut pxr, &[3, 0x03, 0xE8, 0, 60]).expect("a whole block is answered");
        assert_eq!(reply.len(), 122);
        assert_eq!(reply[2 + 2 * 20..2 + 2 * 22], [0, 0, 0, 0]);
    }

    #[test]
    fn a_block_of_settings_is_written_whole_or_not_at_all() {
        let pxr = &mut Pxr::new(27.0);
        check(pxr, &[16, 0x03, 0xED, 0, 2, 4, 0, 12, 0x02, 0xBC], &[16, 0x03, 0xED, 0, 2]);
        check(pxr, &[3, 0x03, 0xED, 0, 2], &[3, 4, 0, 12, 0x02, 0xBC]);
        check(pxr, &[16, 0x03, 0xED, 0, 2, 4, 0, 50, 0xFF, 0xFF], &[0x90, 3]);
        check(pxr, &[3, 0x03, 0xED, 0, 2], &[3, 4, 0, 12, 0x02, 0xBC]);
    }
}
