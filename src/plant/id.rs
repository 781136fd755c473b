//! Numbers that name things: lines, devices, tags, alarms, writes.

use serde::{Deserialize, Serialize};

macro_rules! id {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
        pub struct $name(pub u16);
        impl $name {
            /// The position in the plant's list of these.
            pub fn index(self) -> usize {
                usize::from(self.0)
            }
        }
    };
}

id!(
    /// A line in [`super::PlantDef::lines`].
    LineId
);
id!(
    /// A device in [`super::PlantDef::devices`].
    DeviceId
);
id!(
    /// A tag in [`super::PlantDef::tags`].
    TagId
);
id!(
    /// An alarm in [`super::PlantDef::alarms`].
    AlarmId
);

id!(
    /// A procedure in [`super::PlantDef::procedures`].
    ProcedureId
);

/// Identifies a command: the terminal's number and its running count.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Default, Serialize, Deserialize)]
pub struct CommandId {
    /// Which terminal.
    pub terminal: u32,
    /// Its running count.
    pub number: u32,
}

/// Identifies a write on its way through the bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct WriteId(pub u64);
