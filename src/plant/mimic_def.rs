//! The mimic of the process as its profile describes it.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::id::{DeviceId, TagId};

/// The mimic of the process, on a canvas of nominal cells that is stretched to the screen.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct MimicDef {
    /// Nominal size, columns and rows; 80 by 18 fits a terminal of 80 by 24.
    pub size: (u16, u16),
    /// What is drawn, in this order.
    pub items: Vec<MimicItem>,
    /// Commands offered on the mimic tab.
    pub commands: Vec<MimicCommand>,
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

/// One element of the mimic.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum MimicItem {
    /// A vessel with liquid that follows a level tag.
    Tank {
        /// Where.
        place: MimicRect,
        /// `TK-1 control`.
        label: String,
        /// Level, if measured; its range is the height of the vessel.
        level: Option<TagId>,
        /// Temperature shown inside.
        temperature: Option<TagId>,
        /// Heating power or output; drawn as a heater at the bottom while above zero.
        heater: Option<TagId>,
        /// Agitator run signal.
        agitator: Option<TagId>,
    },
    /// A valve, open while its tag is not zero.
    Valve {
        /// Where (width and height unused).
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
    /// A pipe along points (column, row), with flow from first to last while every tag is not zero.
    Pipe {
        /// Corners of the pipe.
        points: Vec<(u16, u16)>,
        /// All of these must be on for flow.
        flow: Vec<TagId>,
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
