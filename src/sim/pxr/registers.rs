//! The registers of the PXR4: two areas, limits, and what a write sets off.

use super::alarm;
use super::display::Display;
use super::map::{self, Meaning, Row};
use super::{NARROWEST_K, Pxr, SENSOR_C};
use crate::{
    plant::{def::Limits, fault::ExceptionCode, number::to_i16, tag::Table},
    sim::pdu::Registers,
};

/// The functions are those that its manual and working drivers name, so it cannot be asked who it is.
impl Registers for Pxr {
    fn functions(&self) -> &[u8] {
        &[0x03, 0x04, 0x06, 0x10]
    }

    fn limits(&self) -> Limits {
        Limits { read_registers_max: 60, write_registers_max: 60, ..Limits::STANDARD }
    }

    fn bit(&self, _: Table, _: u16) -> Result<bool, ExceptionCode> {
        Err(ExceptionCode::ILLEGAL_FUNCTION)
    }

    fn write_bit(&mut self, _: u16, _: bool) -> Result<(), ExceptionCode> {
        Err(ExceptionCode::ILLEGAL_FUNCTION)
    }

    /// Places between the known settings read as 0, as in the sibling series.
    fn word(&self, table: Table, address: u16) -> Result<u16, ExceptionCode> {
        let (area, place) = area(address)?;
        let (raw, meaning) = match table {
            Table::Input => self.measurement(place)?,
            Table::Holding | Table::Coil | Table::Discrete => (self.settings[place], self.meaning(place)),
        };
        let raw = if area == Area::Internal { self.to_internal(raw, meaning) } else { raw };
        Ok(raw.cast_unsigned())
    }

    fn write_word(&mut self, address: u16, value: u16) -> Result<(), ExceptionCode> {
        let (area, place) = area(address)?;
        let row = map::row(place).ok_or(ExceptionCode::ILLEGAL_ADDRESS)?;
        let raw = value as i16;
        let value = if area == Area::Internal { self.to_display(raw, self.meaning(place)) } else { raw };
        let (min, max) = self.limits(place, row);
        if !(min..=max).contains(&value) {
            return Err(ExceptionCode::ILLEGAL_VALUE);
        }
        match place {
            map::FIX if value == 1 => self.begin_saving(),
            map::UNIT => self.show_as(Display::new(value, self.settings[map::DECIMALS]))?,
            map::DECIMALS => self.show_as(Display::new(self.settings[map::UNIT], value))?,
            _ => {}
        }
        self.settings[place] = value;
        self.keep_limits();
        Ok(())
    }

    /// While settings are being saved a write is held back: it has no answer and no effect, reads go on.
    fn holds_back(&self, function: u8) -> bool {
        self.saving() && matches!(function, 0x06 | 0x10)
    }
}

/// Where the decimals of every temperature stand: 41020.
#[expect(clippy::cast_possible_truncation, reason = "a constant of two digits")]
pub const DECIMALS_AT: (Table, u16) = (Table::Holding, 1_000 + map::DECIMALS as u16);

impl Pxr {
    /// Begins with other decimals: numbers change, temperatures do not.
    pub fn start_with_decimals(&mut self, decimals: u8) {
        let to = Display::new(self.settings[map::UNIT], i16::from(decimals));
        if self.show_as(to).is_ok() {
            self.settings[map::DECIMALS] = i16::from(to.decimals);
        }
    }

    /// The decimals of every temperature.
    pub fn decimals(&self) -> u8 {
        self.display().decimals
    }

    /// How temperatures stand in the registers now.
    pub(super) fn display(&self) -> Display {
        Display::new(self.settings[map::UNIT], self.settings[map::DECIMALS])
    }

    /// The meaning of a setting; that of an alarm point hangs on the type of its alarm.
    fn meaning(&self, place: usize) -> Meaning {
        match map::row(place).map_or(Meaning::Plain, |row| row.meaning) {
            Meaning::AlarmPoint => {
                let (number, upper) = ((place - map::ALARM_POINT) / 2, (place - map::ALARM_POINT) % 2 == 1);
                let shape = alarm::shape(self.settings[map::ALARM_TYPE + number]);
                let from = shape.and_then(|shape| if upper { shape.high } else { shape.low });
                if from == Some(alarm::Base::Zero) { Meaning::Temperature } else { Meaning::Difference }
            }
            meaning => meaning,
        }
    }

    /// The measurements 31001–31010 with their meanings, which decide the number in the internal area.
    fn measurement(&self, place: usize) -> Result<(i16, Meaning), ExceptionCode> {
        let display = self.display();
        let (pv, sv) = (display.temperature(self.pv_c), display.temperature(self.sv_c));
        Ok(match place {
            0 => (pv, Meaning::Temperature),
            1 => (sv, Meaning::Temperature),
            2 => (sv.saturating_sub(pv), Meaning::Difference),
            3 => (to_i16((self.mv_percent * 100.0).round()), Meaning::Plain),
            4 => (0, Meaning::Plain),
            5 => (1, Meaning::Plain),
            6 => (self.alarm_word() as i16, Meaning::Plain),
            7 => (self.faults as i16, Meaning::Plain),
            8 => (self.program.position() as i16, Meaning::Plain),
            9 => (to_i16((self.heater_a * 10.0).round()), Meaning::Plain),
            _ => return Err(ExceptionCode::ILLEGAL_ADDRESS),
        })
    }

    /// From display units to 0.01 % of full scale, which is what the internal area holds.
    fn to_internal(&self, raw: i16, meaning: Meaning) -> i16 {
        let (low, span) = self.scale();
        match meaning {
            Meaning::Temperature => to_i16(((f64::from(raw) - low) / span * 10_000.0).round()),
            Meaning::Difference => to_i16((f64::from(raw) / span * 10_000.0).round()),
            Meaning::Plain | Meaning::End | Meaning::AlarmPoint => raw,
        }
    }

    fn to_display(&self, raw: i16, meaning: Meaning) -> i16 {
        let (low, span) = self.scale();
        match meaning {
            Meaning::Temperature => to_i16((f64::from(raw) / 10_000.0 * span + low).round()),
            Meaning::Difference => to_i16((f64::from(raw) / 10_000.0 * span).round()),
            Meaning::Plain | Meaning::End | Meaning::AlarmPoint => raw,
        }
    }

    fn scale(&self) -> (f64, f64) {
        let low = f64::from(self.settings[map::RANGE_LOW]);
        (low, f64::from(self.settings[map::RANGE_HIGH]) - low)
    }

    /// The limits of a setting now: those of temperatures are settings themselves.
    fn limits(&self, place: usize, row: &Row) -> (i16, i16) {
        let (low, high) = (self.settings[map::RANGE_LOW], self.settings[map::RANGE_HIGH]);
        let span = high.saturating_sub(low);
        let narrowest = self.display().difference(NARROWEST_K);
        match (self.meaning(place), place) {
            (_, map::SV_LOW) => (low, self.settings[map::SV_HIGH]),
            (_, map::SV_HIGH) => (self.settings[map::SV_LOW], high),
            (_, map::RANGE_LOW) => (self.display().temperature(SENSOR_C.0), high.saturating_sub(narrowest)),
            (_, map::RANGE_HIGH) => (low.saturating_add(narrowest), self.display().temperature(SENSOR_C.1)),
            (_, map::SV | map::STEP_SV..map::STEP_TIMES) => (self.settings[map::SV_LOW], self.settings[map::SV_HIGH]),
            (Meaning::Temperature, _) => (low, high),
            (Meaning::Difference, map::ALARM_POINT..map::HEATER_BREAK) => (span.saturating_neg(), span),
            (Meaning::Difference, _) => (0, span / 2),
            (Meaning::Plain | Meaning::End | Meaning::AlarmPoint, _) => (row.min, row.max),
        }
    }

    /// Unit or decimals change: every temperature is rewritten, or nothing is if one would not fit into its word.
    fn show_as(&mut self, to: Display) -> Result<(), ExceptionCode> {
        let from = self.display();
        let mut settings = self.settings;
        for place in map::rows().iter().flat_map(|row| row.places.clone()) {
            let raw = settings[place];
            settings[place] = match self.meaning(place) {
                Meaning::Temperature | Meaning::End => to.temperature(from.temperature_c(raw)),
                Meaning::Difference => to.difference(from.difference_k(raw)),
                Meaning::Plain | Meaning::AlarmPoint => raw,
            };
            // The range itself is the greatest number there is.
            if settings[place] == i16::MAX {
                return Err(ExceptionCode::ILLEGAL_VALUE);
            }
        }
        self.settings = settings;
        Ok(())
    }

    /// What a new range, new limits or a new alarm type leave outside comes back to the nearest limit.
    fn keep_limits(&mut self) {
        let (low, high) = (self.settings[map::RANGE_LOW], self.settings[map::RANGE_HIGH]);
        for place in [map::SV_LOW, map::SV_HIGH] {
            self.settings[place] = self.settings[place].clamp(low, high);
        }
        for row in map::rows()
            .iter()
            .filter(|row| matches!(row.meaning, Meaning::Temperature | Meaning::Difference | Meaning::AlarmPoint))
        {
            for place in row.places.clone() {
                let (min, max) = self.limits(place, row);
                self.settings[place] = self.settings[place].clamp(min, max);
            }
        }
    }
}

/// The two copies of every word (manual of the sibling series): engineering = internal + 1000.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Area {
    Internal,
    Engineering,
}

fn area(address: u16) -> Result<(Area, usize), ExceptionCode> {
    match usize::from(address) {
        place @ 0..map::COUNT => Ok((Area::Internal, place)),
        place if (1000..1000 + map::COUNT).contains(&place) => Ok((Area::Engineering, place - 1000)),
        _ => Err(ExceptionCode::ILLEGAL_ADDRESS),
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
        check(pxr, &[6, 0x03, 0xF6, 0, 1], &[0x86, 2]);
        check(pxr, &[3, 0x03, 0xE8, 0, 61], &[0x83, 3]);
        check(pxr, &[6, 0x03, 0xFB, 0, 3], &[0x86, 3]);
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

    fn read(pxr: &mut Pxr, function: u8, address: u16) -> i16 {
        let [high, low] = address.to_be_bytes();
        let reply = serve(pxr, &[function, high, low, 0, 1]).expect("a request has an answer");
        i16::from_be_bytes([reply[2], reply[3]])
    }

    fn write(pxr: &mut Pxr, address: u16, value: i16) -> bool {
        let [[a, b], [c, d]] = [address.to_be_bytes(), value.to_be_bytes()];
        serve(pxr, &[6, a, b, c, d]).is_some_and(|reply| reply[0] == 6)
    }

    #[test]
    fn decimals_and_unit_change_numbers_not_temperatures() {
        let check = |unit, decimals, sv, sv_high, range_high, hysteresis, pv| {
            let pxr = &mut Pxr::new(27.0);
            pxr.sample(super::super::Sensor::Pt100(27.0), 0.0);
            assert!(write(pxr, 1016, unit) && write(pxr, 1019, decimals));
            let numbers = [1002, 1031, 1018, 1008].map(|address| read(pxr, 3, address));
            assert_eq!((numbers, read(pxr, 4, 1000)), ([sv, sv_high, range_high, hysteresis], pv));
            pxr.sample(super::super::Sensor::Pt100(27.0), 0.0);
            assert_eq!(pxr.sv_c(), 70.0);
        };
        check(0, 0, 70, 120, 185, 1, 27);
        check(0, 1, 700, 1200, 1850, 10, 270);
        check(0, 2, 7000, 12_000, 18_500, 100, 2700);
        check(1, 0, 158, 248, 365, 2, 81);
        check(1, 1, 1580, 2480, 3650, 18, 806);
        // 365.00 °F does not fit into a word, so nothing changes.
        let pxr = &mut Pxr::new(27.0);
        assert!(write(pxr, 1019, 2) && !write(pxr, 1016, 1));
        assert_eq!([1002, 1016].map(|address| read(pxr, 3, address)), [7000, 0]);
    }

    #[test]
    fn a_narrower_range_takes_everything_inside_with_it() {
        let pxr = &mut Pxr::new(27.0);
        assert!(write(pxr, 1056, 1200) && write(pxr, 1018, 500));
        assert_eq!([1002, 1031, 1056].map(|address| read(pxr, 3, address)), [500; 3]);
        assert!(write(pxr, 1017, 400) && !write(pxr, 1017, 401));
        assert_eq!([1002, 1030, 1057].map(|address| read(pxr, 3, address)), [500, 400, 400]);
    }
}
