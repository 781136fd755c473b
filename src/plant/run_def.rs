//! What the plant file says of the control runs of a controller.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::{
    energy::Measures,
    id::{DeviceId, TagId},
};

/// The runs of a controller: each that has PV and SV has them, with the defaults or as a `[[run]]` of the plant file says.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunDef {
    /// The controller; the history knows its runs by its name.
    pub controller: DeviceId,
    /// Setpoint, as it is written.
    pub sv: TagId,
    /// The setpoint in use, if the controller tells it: it confirms one that was not read for a while.
    pub sv_used: Option<TagId>,
    /// Process value.
    pub pv: TagId,
    /// PV this near to SV is at SV, in its unit; `None` for 2 % of the way, 0.5 % of the range at least.
    pub band: Option<f64>,
    /// PV that stays at SV for so long is steady.
    pub steady_for: Duration,
    /// It ends after this time.
    pub duration_max: Duration,
    /// Energy in kWh comes from this power or energy counter.
    pub energy: Option<(TagId, Measures)>,
    /// The start of one of these begins a run, by place in [`PlantDef::batches`](super::PlantDef::batches).
    pub batches: Vec<usize>,
    /// Whose curves are compared.
    pub tags: Vec<TagId>,
}
