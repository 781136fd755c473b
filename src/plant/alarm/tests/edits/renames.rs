//! What is watched gets another name: its alarm goes on where it is certain which it is.

use super::*;
use crate::plant::{
    def::{DeviceDef, DeviceId, Transport},
    tag::TagDef,
};

/// An edit beside the new names, and why the alarms of tag and device end then.
type Case = (fn(&mut PlantDef), Option<&'static str>, Option<&'static str>);

/// What became of the shelved alarm of SV and of the silent controller, by the reason of their ends.
#[test]
fn a_renamed_subject_is_known_only_where_nothing_else_is() {
    let renamed = |edit: fn(&mut PlantDef)| {
        let mut def = edited();
        def.tags[SV.index()].name = "FIC-1.SP".into();
        def.devices[TIC.index()].name = "FIC-1".into();
        edit(&mut def);
        def
    };
    let copied = |def: &mut PlantDef| {
        let copies = [(SV, "B.SV"), (PV, "B.PV")]
            .map(|(tag, name)| TagDef { name: name.into(), ..def.tags[tag.index()].clone() });
        let ids = (5..).map(TagId);
        def.tags.extend(copies.into_iter().zip(ids).map(|(tag, id)| TagDef { id, ..tag }));
        let copy = AlarmDef { subject: Subject::Tag(TagId(5)), ..def.alarms[2].clone() };
        def.alarms.push(copy);
        def.devices.push(DeviceDef { id: DeviceId(2), name: "B".into(), ..def.devices[TIC.index()].clone() });
        def.alarms.push(AlarmDef { subject: Subject::Device(DeviceId(2)), ..def.alarms[6].clone() });
        *def = numbered(def.clone());
    };
    let (sv, tic) = (Some("goes on as FIC-1.SP setpoint high"), Some("goes on as FIC-1 silent"));
    let cases: [Case; 7] = [
        (|_| {}, sv, tic),
        (|def| def.lines[0].name = "L9".into(), sv, tic),
        (|def| def.tags[SV.index()].point.address += 1, None, tic),
        (|def| def.devices[TIC.index()].profile = "other".into(), sv, None),
        (|def| def.devices[TIC.index()].unit = 9, None, None),
        (|def| def.lines[0].transport = Transport::tcp("gateway", 502), None, None),
        (copied, None, None),
    ];
    for (number, (edit, sv, tic)) in cases.into_iter().enumerate() {
        for restarts in [false, true] {
            let mut station = standing();
            let journaled = station.journal.len();
            match restarts {
                true => station.restart(renamed(edit)),
                false => station.reload(renamed(edit)),
            }
            let ended = |subject: &str, message: &str| {
                let mut new = station.journal[journaled..].iter();
                let end = new.find(|event| (&*event.subject, &*event.message) == (subject, message));
                end.map(|event| (event.event, event.reason.as_deref().map(str::to_owned)))
            };
            let expect = |reason: Option<&str>| Some((AlarmEvent::Removed, reason.map(str::to_owned)));
            assert_eq!(ended("TIC-1.SV", "setpoint high"), expect(sv), "case {number}, restarts: {restarts}");
            assert_eq!(ended("TIC-1", "silent"), expect(tic), "case {number}, restarts: {restarts}");
            assert_eq!(station.journaled(), station.standing());
        }
    }
}
