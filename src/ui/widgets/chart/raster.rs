//! Dots and what stands for them: braille where the font has it, half blocks or ASCII where not.

/// How fine a curve can be drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Raster {
    /// 2 by 4 dots a cell.
    Braille,
    /// 1 by 2 dots a cell, glyphs of every console font.
    Half,
    /// 1 by 3 dots a cell, in ASCII.
    Ascii,
}

impl Raster {
    /// Dots of a cell: across, down.
    pub fn dots(self) -> (usize, usize) {
        match self {
            Raster::Braille => (2, 4),
            Raster::Half => (1, 2),
            Raster::Ascii => (1, 3),
        }
    }

    /// The glyph of a cell whose dots are the bits of `dots`, row by row from the top left.
    fn glyph(self, dots: u8) -> char {
        match self {
            Raster::Braille => {
                // Unicode numbers the dots 1 2 3 7 down the left and 4 5 6 8 down the right column.
                const BITS: [u32; 8] = [0x01, 0x08, 0x02, 0x10, 0x04, 0x20, 0x40, 0x80];
                let bits = (0..8).filter(|n| dots & (1 << n) != 0).map(|n| BITS[n]).sum::<u32>();
                char::from_u32(0x2800 + bits).unwrap_or(' ')
            }
            Raster::Half => [' ', '▀', '▄', '█'][usize::from(dots & 3)],
            Raster::Ascii => [' ', '\'', '-', '|', '.', ':', '|', '|'][usize::from(dots & 7)],
        }
    }
}

/// A field of dots, each cell owned by the curve that was drawn into it last.
#[derive(Debug)]
pub struct Canvas {
    raster: Raster,
    width: usize,
    height: usize,
    cells: Vec<(u8, usize)>,
}

impl Canvas {
    /// An empty field of cells.
    pub fn new(raster: Raster, width: usize, height: usize) -> Canvas {
        Canvas { raster, width, height, cells: vec![(0, 0); width * height] }
    }

    /// Dots across and down.
    pub fn size(&self) -> (usize, usize) {
        let (across, down) = self.raster.dots();
        (self.width * across, self.height * down)
    }

    /// Sets the dots of column `x` from row `top` to row `bottom`, both included, for curve `owner`.
    /// What lies outside is left out.
    pub fn bar(&mut self, x: usize, top: usize, bottom: usize, owner: usize) {
        let (across, down) = self.raster.dots();
        for y in top..=bottom {
            let (column, row) = (x / across, y / down);
            if column < self.width && row < self.height {
                let cell = &mut self.cells[row * self.width + column];
                *cell = (cell.0 | 1 << (y % down * across + x % across), owner);
            }
        }
    }

    /// Glyph and owner of every cell that is not empty: column, row, glyph, owner.
    pub fn glyphs(&self) -> impl Iterator<Item = (usize, usize, char, usize)> {
        let cells = self.cells.iter().enumerate().filter(|(_, (dots, _))| *dots != 0);
        cells.map(|(n, (dots, owner))| (n % self.width, n / self.width, self.raster.glyph(*dots), *owner))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(raster: Raster, bars: &[(usize, usize, usize)], expect: &str) {
        let mut canvas = Canvas::new(raster, 3, 1);
        for (x, top, bottom) in bars {
            canvas.bar(*x, *top, *bottom, 0);
        }
        let mut drawn = [' '; 3];
        canvas.glyphs().for_each(|(x, _, glyph, _)| drawn[x] = glyph);
        assert_eq!(drawn.iter().collect::<String>(), expect, "{raster:?} {bars:?}");
    }

    #[test]
    fn dots_become_the_glyphs_that_look_like_them() {
        check(Raster::Braille, &[(0, 0, 3), (3, 0, 0), (4, 3, 3)], "⡇⠈⡀");
        check(Raster::Braille, &[(0, 1, 1), (1, 2, 2)], "⠢  ");
        check(Raster::Half, &[(0, 0, 0), (1, 1, 1), (2, 0, 1)], "▀▄█");
        check(Raster::Ascii, &[(0, 0, 0), (1, 1, 1), (2, 2, 2)], "'-.");
        check(Raster::Ascii, &[(0, 0, 2)], "|  ");
        check(Raster::Ascii, &[], "   ");
    }

    #[test]
    fn dots_outside_the_field_are_left_out() {
        check(Raster::Braille, &[(6, 0, 3), (0, 4, 9)], "   ");
    }
}
