//! The task that owns the rig, and the handle that lines, tests and pages talk to it through.

use std::time::Duration;

use jiff::Timestamp;
use tokio::sync::{mpsc, oneshot};

use crate::bus::io::clock::Clock;
use crate::sim::faults::{Answer, Fault, Faults};
use crate::sim::rig::{Rig, Truth};

/// Orders that may wait; a full queue makes the sender wait, and the task always drains it.
const ORDERS_MAX: usize = 64;
/// The rig is brought up to date this often when nobody asks (plant time), but not oftener than the real interval.
const IDLE: Duration = Duration::from_secs(1);
const IDLE_REAL_MIN: Duration = Duration::from_millis(50);
/// The most plant time made up for at once, after the machine was asleep or overloaded; the rest is not simulated.
const CATCH_UP_MAX: Duration = Duration::from_secs(3600);

/// Speaks to the task that owns the rig. The task ends when the last handle is gone.
#[derive(Debug, Clone)]
pub struct RigHandle {
    orders: mpsc::Sender<Order>,
    clock: Clock,
}

/// What a task waits for when it asks the rig; if the task is gone, nothing comes back.
type Reply<T> = oneshot::Sender<T>;

#[derive(Debug)]
enum Order {
    Ask { unit: u8, pdu: Vec<u8>, reply: Reply<Option<Answer>> },
    Tell(Told, Reply<()>),
    Truth(Reply<Truth>),
}

#[derive(Debug)]
enum Told {
    Fault(u8, Fault),
    SensorOpen(bool),
    Switch(u16, bool),
    PowerCycle,
    Spoiled,
}

impl RigHandle {
    /// Starts the task. The rig lives in the plant time of `clock`.
    pub fn spawn(rig: Rig, clock: Clock) -> RigHandle {
        let (orders, inbox) = mpsc::channel(ORDERS_MAX);
        tokio::spawn(run(rig, clock, clock.now(), inbox));
        RigHandle { orders, clock }
    }

    /// The clock of the rig.
    pub fn clock(&self) -> Clock {
        self.clock
    }

    /// Puts a request to a unit. `None`: nothing comes back, now or ever.
    pub async fn ask(&self, unit: u8, pdu: &[u8]) -> Option<Answer> {
        let (reply, answer) = oneshot::channel();
        self.orders.send(Order::Ask { unit, pdu: pdu.to_vec(), reply }).await.ok()?;
        answer.await.ok().flatten()
    }

    /// Makes a unit faulty, or well again.
    pub async fn set_fault(&self, unit: u8, fault: Fault) {
        self.tell(Told::Fault(unit, fault)).await;
    }

    /// Breaks or repairs the wire of the temperature sensor.
    pub async fn set_sensor_open(&self, open: bool) {
        self.tell(Told::SensorOpen(open)).await;
    }

    /// Turns a panel switch X0–X3 of the PLC.
    pub async fn set_switch(&self, switch: u16, on: bool) {
        self.tell(Told::Switch(switch, on)).await;
    }

    /// Takes the power from all devices and gives it back.
    pub async fn power_cycle(&self) {
        self.tell(Told::PowerCycle).await;
    }

    /// Something passed on the line that no unit could read.
    pub async fn spoiled(&self) {
        self.tell(Told::Spoiled).await;
    }

    /// What is really so in the rig now; `None` once its task has ended.
    pub async fn truth(&self) -> Option<Truth> {
        let (reply, truth) = oneshot::channel();
        self.orders.send(Order::Truth(reply)).await.ok()?;
        truth.await.ok()
    }

    /// Returns when it is in force. The task lives as long as this handle, except while its runtime shuts down; then
    /// there is nobody to tell.
    async fn tell(&self, told: Told) {
        let (reply, done) = oneshot::channel();
        if self.orders.send(Order::Tell(told, reply)).await.is_ok() {
            done.await.ok();
        }
    }
}

async fn run(mut rig: Rig, clock: Clock, mut reached: Timestamp, mut inbox: mpsc::Receiver<Order>) {
    let mut faults = Faults::default();
    let idle = IDLE.max(IDLE_REAL_MIN.mul_f64(clock.speed()));
    loop {
        let order = tokio::select! {
            order = inbox.recv() => match order {
                Some(order) => Some(order),
                None => return,
            },
            () = clock.sleep(idle) => None,
        };
        let now = clock.now();
        rig.advance(Duration::try_from(now.duration_since(reached)).unwrap_or_default().min(CATCH_UP_MAX));
        reached = now;
        if let Some(order) = order {
            obey(&mut rig, &mut faults, order);
        }
    }
}

/// Who asked may have gone meanwhile; an answer that nobody waits for is dropped.
fn obey(rig: &mut Rig, faults: &mut Faults, order: Order) {
    match order {
        Order::Ask { unit, pdu, reply } => {
            reply.send(faults.answer(rig, unit, &pdu)).ok();
        }
        Order::Truth(reply) => {
            reply.send(rig.truth()).ok();
        }
        Order::Tell(told, done) => {
            match told {
                Told::Fault(unit, fault) => faults.set(unit, fault),
                Told::SensorOpen(open) => rig.set_sensor_open(open),
                Told::Switch(switch, on) => rig.set_switch(switch, on),
                Told::PowerCycle => rig.power_cycle(),
                Told::Spoiled => rig.spoiled(),
            }
            done.send(()).ok();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::dl06::sequence::Step;

    #[tokio::test(start_paused = true)]
    async fn the_rig_lives_in_plant_time() {
        let rig = RigHandle::spawn(Rig::demo(), Clock::starting_at(Timestamp::UNIX_EPOCH, 60.0));
        tokio::time::advance(Duration::from_secs(5)).await;
        let truth = rig.truth().await.expect("the task runs");
        // Five real seconds are five minutes of plant: filled, and about 270 s of heating done.
        assert_eq!(truth.step, Step::Heat);
        assert!((40.0..50.0).contains(&truth.probe_c), "{truth:?}");
    }

    #[tokio::test(start_paused = true)]
    async fn faults_reach_the_rig() {
        let rig = RigHandle::spawn(Rig::demo(), Clock::starting_at(Timestamp::UNIX_EPOCH, 1.0));
        rig.set_fault(1, Fault::Silent).await;
        assert_eq!(rig.ask(1, &[3, 3, 0xEA, 0, 1]).await, None);
        assert!(rig.ask(2, &[3, 4, 0, 0, 1]).await.is_some());
        rig.set_sensor_open(true).await;
        tokio::time::advance(Duration::from_secs(1)).await;
        let truth = rig.truth().await.expect("the task runs");
        assert!(truth.pv_c > 190.0 && truth.mv_percent == 0.0, "{truth:?}");
        rig.power_cycle().await;
        tokio::time::advance(Duration::from_secs(1)).await;
        assert_eq!(rig.truth().await.map(|truth| truth.step), Some(Step::Idle));
    }
}
