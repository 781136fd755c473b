//! The tabs that were shown, one after the other: back and forward, as in a browser.

use super::tabs::Tab;

const TABS_MAX: usize = 32;

/// What was shown before and behind the shown tab.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Visited {
    before: Vec<Tab>,
    behind: Vec<Tab>,
    /// The tab that back or forward leads to.
    on_way: Option<Tab>,
}

impl Visited {
    /// Another tab is shown. What was gone back from is forgotten unless back or forward leads there.
    pub fn note(&mut self, from: Tab, to: Tab) {
        if from == to || self.on_way.take() == Some(to) {
            return;
        }
        self.behind.clear();
        self.before.push(from);
        if TABS_MAX < self.before.len() {
            self.before.remove(0);
        }
    }

    /// The tab that was shown before this one, or after it, of those that are offered now.
    pub fn step(&mut self, shown: Tab, offered: &[Tab], forward: bool) -> Option<Tab> {
        let (from, to) =
            if forward { (&mut self.behind, &mut self.before) } else { (&mut self.before, &mut self.behind) };
        from.retain(|tab| offered.contains(tab));
        let tab = from.pop()?;
        to.push(shown);
        self.on_way = Some(tab);
        Some(tab)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn back_and_forward_lead_along_the_same_tabs() {
        let mut visited = Visited::default();
        let mut shown = Tab::Mimic;
        let mut show = |visited: &mut Visited, tab: Tab| {
            visited.note(shown, tab);
            shown = tab;
        };
        for tab in [Tab::Trends, Tab::Trends, Tab::Alarms, Tab::Bus] {
            show(&mut visited, tab);
        }
        for (shown, forward, expect) in [
            (Tab::Bus, false, Some(Tab::Alarms)),
            (Tab::Alarms, false, Some(Tab::Trends)),
            (Tab::Trends, true, Some(Tab::Alarms)),
            (Tab::Alarms, false, Some(Tab::Trends)),
            (Tab::Trends, false, Some(Tab::Mimic)),
            (Tab::Mimic, false, None),
        ] {
            let to = visited.step(shown, &Tab::ALL, forward);
            assert_eq!(to, expect, "{shown:?}");
            visited.note(shown, to.unwrap_or(shown));
        }
        visited.note(Tab::Mimic, Tab::Users);
        assert_eq!(visited.step(Tab::Users, &Tab::ALL, true), None, "a new way has no forward");
        assert_eq!(visited.step(Tab::Users, &Tab::ALL, false), Some(Tab::Mimic));
        visited.note(Tab::Users, Tab::Mimic);
        assert_eq!(visited.step(Tab::Mimic, &[Tab::Mimic, Tab::Trends], false), None, "one that is not there any more");
    }
}
