//! What is never polled is read when an operator asks for everything of a device.

use super::*;
use crate::plant::command::CommandId;

const SECOND: fn(i64) -> Timestamp = |second| Timestamp::from_second(second).expect("a small number");

#[tokio::test(start_paused = true)]
async fn what_is_never_polled_is_read_on_request_only() {
    let mut def = plant(Mode::Rtu);
    let never = def.tags.iter().position(|tag| tag.point.address == 400).expect("a tag of the first unit");
    def.tags[never].poll = Poll::Never;
    let never = TagId(u16::try_from(never).expect("a small number"));
    let mut line = line(def.clone());
    line.plug(Mode::Rtu, |_, _| SlaveAction::Answer);
    let reads = async |line: &mut slave::Line, until: i64| {
        let mut times = Vec::new();
        loop {
            let Event::Read { at, values, .. } = line.next(&def).await else { continue };
            times.extend(values.iter().filter(|(tag, _)| *tag == never).map(|_| at.as_second()));
            if SECOND(until) <= at {
                return times;
            }
        }
    };
    assert_eq!(reads(&mut line, 60).await, [0i64; 0], "no operator has asked");
    // The station itself asks again for what has changed: that is not an operator.
    let refresh = |command| BusRequest::Refresh { device: DeviceId(0), command };
    line.requests.send(refresh(None)).await.expect("the line runs");
    assert_eq!(reads(&mut line, 90).await, [0i64; 0]);
    for (until, asked) in [(150, 90), (210, 150)] {
        let id = CommandId { terminal: 1, number: 1 };
        line.requests.send(refresh(Some(id))).await.expect("the line runs");
        let times = reads(&mut line, until).await;
        assert!(matches!(times[..], [once] if once <= asked + 2), "{times:?}");
    }
}
