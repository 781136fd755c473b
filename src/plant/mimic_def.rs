//! The mimic of the process: pages of pictures that the plant file draws in text.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::id::{DeviceId, TagId};

/// The mimic of the process.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct MimicDef {
    /// Its pages, the first is shown first; none where the plant file draws none.
    pub pages: Vec<MimicPage>,
    /// Commands offered on the mimic tab.
    pub commands: Vec<MimicCommand>,
}

/// A page of the mimic.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MimicPage {
    /// Its heading.
    pub name: String,
    /// The same process for terminals of several sizes, the smallest picture first.
    pub pictures: Vec<Picture>,
}

/// A picture on a canvas of nominal cells, which may be stretched to the screen.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Picture {
    /// Columns and rows; 80 by 18 fits a terminal of 80 by 24.
    pub size: (u16, u16),
    /// What is drawn, in this order.
    pub items: Vec<MimicItem>,
}

impl Picture {
    /// What is shown where the plant file draws nothing.
    pub fn empty() -> &'static Picture {
        static EMPTY: Picture = Picture { size: (1, 1), items: Vec::new() };
        &EMPTY
    }
}

impl MimicPage {
    /// The largest picture that fits into this many columns and rows; the smallest where none does.
    pub fn picture(&self, room: (u16, u16)) -> &Picture {
        let fits = |picture: &&Picture| picture.size.0 <= room.0 && picture.size.1 <= room.1;
        self.pictures.iter().rev().find(fits).or(self.pictures.first()).unwrap_or(Picture::empty())
    }
}

/// A rectangle on the nominal canvas.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct MimicRect {
    /// Column of the left edge.
    pub x: u16,
    /// Row of the top edge.
    pub y: u16,
    /// Columns.
    pub width: u16,
    /// Rows.
    pub height: u16,
}

/// One element of a picture.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum MimicItem {
    /// A box; with a level its liquid follows it.
    Vessel {
        /// Where.
        place: MimicRect,
        /// `TK-1 control`, written into the upper edge.
        label: String,
        /// Level, if it holds a liquid; its range is the height of the vessel.
        level: Option<TagId>,
        /// All that is shown inside.
        inside: Vec<TagId>,
    },
    /// A valve, open while its tag is not zero.
    Valve {
        /// Where: the columns of its pipe that it takes.
        place: MimicRect,
        /// `SV-1`.
        label: String,
        /// State.
        tag: TagId,
        /// Drawn in a vertical pipe.
        vertical: bool,
    },
    /// A pump, running while its tag is not zero.
    Pump {
        /// Where.
        place: MimicRect,
        /// `P-1`.
        label: String,
        /// State.
        tag: TagId,
    },
    /// An agitator, which turns while its tag is not zero.
    Agitator {
        /// Where.
        place: MimicRect,
        /// Run signal.
        tag: TagId,
    },
    /// A heater, which glows while its tag is not zero.
    Heater {
        /// Where.
        place: MimicRect,
        /// Power or output.
        tag: TagId,
    },
    /// A pipe along points (column, row), with flow from first to last.
    Pipe {
        /// Corners of the pipe.
        points: Vec<(u16, u16)>,
        /// It flows while all tags of one of these are not zero: of its own, or of the pipes that lead to it. Unknown
        /// where there are none, or no tags of one.
        flow: Vec<Vec<TagId>>,
        /// Its direction is drawn: arrows travel along it.
        directed: bool,
    },
    /// Where three or four pipes meet.
    Joint {
        /// Column and row.
        at: (u16, u16),
        /// The branches: right 1, down 2, left 4, up 8.
        branches: u8,
    },
    /// A value with unit and quality.
    Value {
        /// Where.
        place: MimicRect,
        /// Shown before the value.
        label: String,
        /// What.
        tag: TagId,
    },
    /// A value on its range, with the limits of its alarms: upright where it is higher than one row.
    Bar {
        /// Where.
        place: MimicRect,
        /// What.
        tag: TagId,
    },
    /// PV, SV, MV and bar of a controller.
    Controller {
        /// Where.
        place: MimicRect,
        /// Which device; it has a faceplate.
        device: DeviceId,
    },
    /// The steps of a sequence, the present one marked.
    Sequence {
        /// Where.
        place: MimicRect,
        /// Heading.
        label: String,
        /// The step tag; its enum labels are the steps.
        step: TagId,
        /// Seconds left in the step.
        remaining: Option<TagId>,
        /// Run / stop and auto / manual, shown below.
        states: Vec<TagId>,
    },
    /// A small trend of the last minutes.
    Trend {
        /// Where.
        place: MimicRect,
        /// What.
        tag: TagId,
        /// How far back.
        window: Duration,
    },
    /// Leads to another page.
    Link {
        /// Where.
        place: MimicRect,
        /// The number of the page, from 0.
        page: usize,
    },
    /// Plain words.
    Text {
        /// Where.
        place: MimicRect,
        /// The words.
        text: String,
    },
}

/// A command on the mimic tab: one key, one tag, one value or a toggle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MimicCommand {
    /// The key: one lower-case letter.
    pub key: char,
    /// `run/stop`.
    pub label: String,
    /// What it writes.
    pub tag: TagId,
    /// A fixed value; `None` toggles a two-state tag or asks for a number.
    pub value: Option<f64>,
}
