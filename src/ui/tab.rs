//! Which tabs there are, and which of them are offered.

use super::{ViewContext, keys, layout::Size, rights};
use crate::plant::{PlantDef, number::to_u32, role::Role};

/// The table of tabs, in the order of their number keys from 0: name, title, help.
macro_rules! tabs {
    ($($tab:ident: $title:literal, $help:literal;)+) => {
        #[allow(missing_docs)]
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        pub enum Tab {
            $($tab),+
        }

        impl Tab {
            /// Every tab, in the order of its number key.
            pub const ALL: [Tab; [$(Tab::$tab),+].len()] = [$(Tab::$tab),+];

            pub fn title(self) -> &'static str {
                match self { $(Tab::$tab => $title),+ }
            }
            /// What its number key shows, for the help.
            pub fn help(self) -> &'static str {
                match self { $(Tab::$tab => $help),+ }
            }
        }
    };
}

tabs! {
    Login: "Login", "log in, log out, password";
    Mimic: "Mimic", "mimic";
    Trends: "Trends", "trends";
    Alarms: "Alarms", "alarms";
    Controllers: "Controllers", "controllers";
    Reports: "Reports", "reports";
    Bus: "Bus", "bus: lines, frames, tests";
    Users: "Users", "users and audit log: for a Supervisor";
    Faults: "Faults", "faults: of a simulated plant only";
    Registers: "Registers", "the registers of a device, without a plant file";
}

impl Tab {
    pub fn offered(cx: &ViewContext) -> Vec<Tab> {
        Tab::ALL
            .into_iter()
            .filter(|tab| tab.is_of_bench() || !cx.def().is_bench())
            .filter(|tab| tab.is_offered(cx) && (tab.has_past() || !cx.is_past()))
            .filter(|tab| tab.is_compact() || cx.size != Size::Compact)
            .collect()
    }

    /// Before a login nothing but the login page, unless the plant file lets anonymous users look.
    fn is_offered(self, cx: &ViewContext) -> bool {
        let open = !rights::is_closed(cx.session);
        match self {
            Tab::Login => true,
            Tab::Registers => cx.def().is_bench(),
            Tab::Bus => open && !cx.def().lines.is_empty(),
            Tab::Users => open && cx.session.who.as_ref().is_some_and(|who| who.role == Role::Supervisor),
            Tab::Faults => open && cx.extension.is_some_and(|extension| extension.has_tab()),
            Tab::Mimic | Tab::Trends | Tab::Alarms | Tab::Controllers | Tab::Reports => open,
        }
    }

    /// The tab that a terminal begins with.
    pub fn home(def: &PlantDef) -> Tab {
        if def.is_bench() { Tab::Registers } else { Tab::Mimic }
    }

    /// Does it show the plant, so that it can show it as it was? A report is of a period of its own.
    pub fn has_past(self) -> bool {
        matches!(self, Tab::Mimic | Tab::Trends | Tab::Alarms | Tab::Controllers | Tab::Bus)
    }

    /// Is it a list that the smallest screens have room for?
    pub fn is_compact(self) -> bool {
        matches!(self, Tab::Mimic | Tab::Alarms)
    }

    /// Has it something to show where no plant file says what the registers of a device mean?
    fn is_of_bench(self) -> bool {
        matches!(self, Tab::Bus | Tab::Registers)
    }

    /// The digit of its number key.
    pub fn number(self) -> usize {
        Tab::ALL.iter().position(|tab| *tab == self).unwrap_or(0)
    }

    /// The number key that shows it.
    pub fn key(self) -> keys::Chord {
        keys::char(char::from_digit(to_u32(self.number()), 10).unwrap_or('0'))
    }
}
