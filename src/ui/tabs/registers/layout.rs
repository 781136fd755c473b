//! Where the columns of the registers stand.

/// Where each column begins; the widest screens have all of them.
pub struct Layout {
    pub unsigned: u16,
    pub signed: u16,
    pub bcd: Option<u16>,
    pub long: Option<u16>,
    pub float: u16,
    pub bits: u16,
    pub text: u16,
    pub age: u16,
    pub hint: u16,
}

pub fn layout(width: u16) -> Layout {
    let bcd = (120 <= width).then_some(36);
    let long = (100 <= width).then_some(if bcd.is_some() { 42 } else { 37 });
    let float = long.map_or(36, |long| long + 13);
    let bits = float + 12;
    Layout { unsigned: 22, signed: 29, bcd, long, float, bits, text: bits + 20, age: bits + 23, hint: bits + 30 }
}

/// Where names stand, and their room: behind the other columns, else over the bits.
pub fn name_column(at: &Layout, width: u16) -> (u16, u16) {
    let behind = width.saturating_sub(at.hint);
    if 20 <= behind { (at.hint + 1, behind - 1) } else { (at.bits, 22) }
}
