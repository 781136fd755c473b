//! The task that owns the simulator, and the handle that lines, tests and pages use.

use std::{collections::BTreeSet, sync::Arc, time::Duration};

use jiff::Timestamp;
use tokio::sync::{mpsc, oneshot};

use crate::{
    bus::io::clock::Clock,
    plant::{
        PlantDef,
        def::{LineId, TagId},
        time::elapsed,
    },
    sim::{
        faults::{ActiveFault, Answer, FaultTarget, Faults, InjectedFault},
        ground_truth::GroundTruth,
        scenario::judge::ActualValues,
        simulator::Simulator,
    },
};

/// Requests that may wait; a full queue makes the sender wait, and the task always drains it.
const REQUESTS_MAX: usize = 64;
/// The simulator advances at least this often (plant time), but not more often than the real interval.
const IDLE: Duration = Duration::from_secs(1);
const IDLE_REAL_MIN: Duration = Duration::from_millis(50);
/// The most plant time made up for at once, after the machine was asleep or overloaded; the rest is not simulated.
const CATCH_UP_MAX: Duration = Duration::from_secs(3600);

/// Handle of the task that owns the simulator. The task ends when the last handle is gone.
#[derive(Debug, Clone)]
pub struct SimulatorHandle {
    requests: mpsc::Sender<Request>,
    clock: Clock,
    units: Arc<BTreeSet<(LineId, u8)>>,
}

/// Speaks to the units of one line.
#[derive(Debug, Clone)]
pub struct LineHandle {
    simulator: SimulatorHandle,
    line: LineId,
}

/// Active faults and actual values of a simulator.
#[derive(Debug, Clone, PartialEq)]
pub struct Report {
    /// The active faults.
    pub active: Vec<ActiveFault>,
    /// By tag.
    pub actual: ActualValues,
}

/// Work on the simulator, in its task.
type Request = Box<dyn FnOnce(&mut Owned) + Send>;

/// What the task owns.
struct Owned {
    simulator: Simulator,
    faults: Faults,
    ground_truth: GroundTruth,
    /// Plant time up to which the simulator has advanced.
    now: Timestamp,
}

impl SimulatorHandle {
    /// Starts the task. The simulator lives in the plant time of `clock`; of its values nothing is known.
    pub fn spawn(simulator: Simulator, clock: Clock) -> SimulatorHandle {
        SimulatorHandle::start(simulator, clock, Faults::default(), GroundTruth::default())
    }

    /// The same for a plant whose values are known: faults can be injected, and actual values are reported.
    pub fn spawn_for(def: &PlantDef, simulator: Simulator, clock: Clock) -> SimulatorHandle {
        SimulatorHandle::start(simulator, clock, Faults::new(def), GroundTruth::new(def))
    }

    fn start(simulator: Simulator, clock: Clock, faults: Faults, ground_truth: GroundTruth) -> SimulatorHandle {
        let (requests, inbox) = mpsc::channel(REQUESTS_MAX);
        let units = Arc::new(simulator.addresses().collect());
        tokio::spawn(run(Owned { simulator, faults, ground_truth, now: clock.now() }, clock, inbox));
        SimulatorHandle { requests, clock, units }
    }

    /// The clock of the simulator.
    pub fn clock(&self) -> Clock {
        self.clock
    }

    /// The units of one line, to serve them.
    pub fn line(&self, line: LineId) -> LineHandle {
        LineHandle { simulator: self.clone(), line }
    }

    /// Every unit of the simulator, by its line.
    pub fn units(&self) -> impl Iterator<Item = (LineId, u8)> + '_ {
        self.units.iter().copied()
    }

    /// Puts a request to a unit of a line. `None`: nothing comes back, now or ever.
    pub async fn ask(&self, line: LineId, unit: u8, pdu: &[u8]) -> Option<Answer> {
        let pdu = pdu.to_vec();
        self.put(move |owned| owned.faults.answer(&mut owned.simulator, line, unit, &pdu)).await.flatten()
    }

    /// Injects a fault into a unit of a line.
    pub async fn inject_into_unit(&self, line: LineId, unit: u8, fault: InjectedFault) {
        self.inject(FaultTarget::Unit(line, unit), fault).await;
    }

    /// Injects a fault; a fault that it excludes is cleared.
    pub async fn inject(&self, target: FaultTarget, fault: InjectedFault) {
        self.put(move |owned| owned.faults.inject(&mut owned.simulator, target, fault, owned.now)).await;
    }

    /// Clears a fault, whatever its parameter.
    pub async fn clear(&self, target: FaultTarget, fault: InjectedFault) {
        self.put(move |owned| owned.faults.clear(&mut owned.simulator, target, fault)).await;
    }

    /// Clears all faults.
    pub async fn clear_all(&self) {
        self.put(|owned| owned.faults.clear_all(&mut owned.simulator)).await;
    }

    /// The active faults and the actual values now; `None` once the task has ended.
    pub async fn report(&self) -> Option<Report> {
        self.put(|owned| Report {
            active: owned.faults.list().to_vec(),
            actual: owned.ground_truth.values(&owned.simulator),
        })
        .await
    }

    /// What a modelled device holds for a tag now, in the tag's unit; `None` for a tag of the rig.
    pub async fn value(&self, tag: TagId) -> Option<f64> {
        self.put(move |owned| owned.simulator.value(tag)).await.flatten()
    }

    /// Does the work in the task and returns its result. The task lives as long as this handle, except while its runtime
    /// shuts down; then there is no result.
    async fn put<T: Send + 'static>(&self, work: impl FnOnce(&mut Owned) -> T + Send + 'static) -> Option<T> {
        let (reply, result) = oneshot::channel();
        // The result for a requester that has gone is dropped.
        let request: Request = Box::new(move |owned| drop(reply.send(work(owned))));
        self.requests.send(request).await.ok()?;
        result.await.ok()
    }
}

impl LineHandle {
    /// The clock of the simulator.
    pub fn clock(&self) -> Clock {
        self.simulator.clock
    }

    /// Whether a unit has this address.
    pub fn has(&self, unit: u8) -> bool {
        self.simulator.units.contains(&(self.line, unit))
    }

    /// Puts a request to a unit. `None`: nothing comes back, now or ever.
    pub async fn ask(&self, unit: u8, pdu: &[u8]) -> Option<Answer> {
        self.simulator.ask(self.line, unit, pdu).await
    }

    /// Something passed on the line that no unit could read.
    pub async fn corrupt(&self) {
        let line = self.line;
        self.simulator.put(move |owned| owned.simulator.corrupt(line)).await;
    }
}

async fn run(mut owned: Owned, clock: Clock, mut inbox: mpsc::Receiver<Request>) {
    let idle = IDLE.max(IDLE_REAL_MIN.mul_f64(clock.speed()));
    loop {
        let request = tokio::select! {
            // A replay must come to the same end.
            biased;
            request = inbox.recv() => match request {
                Some(request) => Some(request),
                None => return,
            },
            () = clock.sleep(idle) => None,
        };
        let now = clock.now();
        let passed = elapsed(owned.now, now);
        owned.simulator.advance(passed.min(CATCH_UP_MAX));
        owned.now = now;
        if let Some(request) = request {
            request(&mut owned);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::{
        dl06::sequence::Step,
        rig::{Rig, RigState},
    };

    async fn rig_state(simulator: &SimulatorHandle) -> RigState {
        simulator.put(|owned| owned.simulator.rig().map(Rig::state)).await.flatten().expect("the task runs")
    }

    #[tokio::test(start_paused = true)]
    async fn the_rig_lives_in_plant_time() {
        let simulator =
            SimulatorHandle::spawn(Simulator::tank(Rig::demo()), Clock::starting_at(Timestamp::UNIX_EPOCH, 60.0));
        tokio::time::advance(Duration::from_secs(5)).await;
        let state = rig_state(&simulator).await;
        // Five real seconds are five minutes of plant: filled, and about 270 s of heating done.
        assert_eq!(state.step, Step::Heat);
        assert!((40.0..50.0).contains(&state.probe_c), "{state:?}");
    }

    #[tokio::test(start_paused = true)]
    async fn faults_reach_the_units() {
        let simulator =
            SimulatorHandle::spawn(Simulator::tank(Rig::demo()), Clock::starting_at(Timestamp::UNIX_EPOCH, 1.0));
        simulator.inject_into_unit(LineId(0), 1, InjectedFault::Silent).await;
        assert_eq!(simulator.ask(LineId(0), 1, &[3, 3, 0xEA, 0, 1]).await, None);
        assert!(simulator.ask(LineId(0), 2, &[3, 4, 0, 0, 1]).await.is_some());
        simulator.inject(FaultTarget::Unit(LineId(0), 1), InjectedFault::SensorBurnout).await;
        tokio::time::advance(Duration::from_secs(1)).await;
        let state = rig_state(&simulator).await;
        assert!(state.pv_c > 190.0 && state.mv_percent == 0.0, "{state:?}");
    }
}
