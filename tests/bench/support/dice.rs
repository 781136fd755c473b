//! Numbers as if by chance.

/// A linear congruential generator (Knuth's MMIX): the same on every machine.
#[derive(Debug, Clone, Copy)]
pub struct Dice(pub u64);

// Each of those who include it takes what it needs.
#[allow(dead_code)]
impl Dice {
    /// Less than a limit.
    pub fn below(&mut self, limit: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % limit.max(1)
    }

    /// A place in a list of so many.
    pub fn place(&mut self, count: usize) -> usize {
        usize::try_from(self.below(count as u64)).unwrap_or_default()
    }

    /// True so often: 0.01 is once in a hundred.
    pub fn chance(&mut self, rate: f64) -> bool {
        0.0 < rate && (self.below(1 << 30) as f64) < rate * (1u64 << 30) as f64
    }
}
