//! The sizes of a terminal at which pages show more or less, and where the parts of its screen are; pure.

use ratatui::layout::Rect;

/// How much a terminal can show. No page has a breakpoint of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Size {
    /// The banner only.
    Tiny,
    /// Banner, and one list of values or of alarms. Nothing is written here: a confirmation might not be seen whole.
    Compact,
    /// Every tab, with lists instead of pictures.
    Narrow,
    /// Every tab.
    Normal,
    /// What belongs together stands side by side.
    Wide,
    /// Several of a kind stand side by side.
    Overview,
}

/// The least columns and rows of each size, the largest first.
const LEAST: [(Size, (u16, u16)); 5] = [
    (Size::Overview, (150, 45)),
    (Size::Wide, (110, 16)),
    (Size::Normal, (80, 24)),
    (Size::Narrow, (60, 16)),
    (Size::Compact, (36, 8)),
];

impl Size {
    pub fn of(screen: Rect) -> Size {
        let fits = |(_, (columns, rows)): &&(Size, (u16, u16))| *columns <= screen.width && *rows <= screen.height;
        LEAST.iter().find(fits).map_or(Size::Tiny, |(size, _)| *size)
    }

    /// The columns and rows that it needs.
    pub fn least(self) -> (u16, u16) {
        LEAST.iter().find(|(size, _)| *size == self).map_or((0, 0), |(_, least)| *least)
    }

    /// Do so many columns suffice for two things side by side?
    pub fn is_wide(columns: u16) -> bool {
        Size::Wide.least().0 <= columns
    }
}

/// Where the parts of the screen are. What has no place is empty.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layout {
    /// Plant, lines, clock.
    pub header: Rect,
    /// Names of the tabs.
    pub tabs: Rect,
    /// The most urgent alarm.
    pub banner: Rect,
    /// The line between banner and body.
    pub rule: Rect,
    /// The tab.
    pub body: Rect,
    /// Outcome of the last command.
    pub status: Rect,
    pub footer: Rect,
}

pub fn layout(screen: Rect) -> Layout {
    let row = |y: u16| Rect { y: screen.y.saturating_add(y), height: 1, ..screen }.intersection(screen);
    let none = Rect { width: 0, height: 0, ..screen };
    let (header, tabs, banner, rule, first) = match Size::of(screen) {
        Size::Tiny => {
            let (header, tabs, rule, body, status, footer) = (none, none, none, none, none, none);
            return Layout { header, tabs, banner: row(0), rule, body, status, footer };
        }
        Size::Compact => (none, none, row(0), none, 1),
        Size::Narrow | Size::Normal | Size::Wide | Size::Overview => (row(0), row(1), row(2), row(3), 4),
    };
    Layout {
        header,
        tabs,
        banner,
        rule,
        body: Rect { y: screen.y + first, height: screen.height - first - 2, ..screen },
        status: row(screen.height - 2),
        footer: row(screen.height - 1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_screen_has_the_largest_size_that_fits() {
        let check = |width, height, expect| assert_eq!(Size::of(Rect::new(0, 0, width, height)), expect);
        check(35, 40, Size::Tiny);
        check(200, 7, Size::Tiny);
        check(40, 12, Size::Compact);
        check(59, 60, Size::Compact);
        check(60, 20, Size::Narrow);
        check(80, 24, Size::Normal);
        check(109, 44, Size::Normal);
        check(110, 16, Size::Wide);
        check(149, 60, Size::Wide);
        check(160, 50, Size::Overview);
    }

    #[test]
    fn the_parts_of_a_screen_do_not_overlap() {
        for (width, height) in (0..160).flat_map(|width| (0..60).map(move |height| (width, height))) {
            let parts = layout(Rect::new(0, 0, width, height));
            let Layout { header, tabs, banner, rule, body, status, footer } = parts;
            let all = [header, tabs, banner, rule, body, status, footer];
            for (n, part) in all.iter().enumerate() {
                let apart = |other: &Rect| !other.intersects(*part);
                assert!(all[..n].iter().all(apart), "{width}x{height}: {parts:?}");
            }
        }
    }
}
