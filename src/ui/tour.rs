//! The tour of a demonstration: eight small tasks on the living plant, and a page of what was done.
//!
//! A task is shown until the terminal is in the state that it asks for; nothing is checked but what the operator sees.

use super::{
    Effect, Model, Msg, TICK, UiAction, ViewContext,
    extension::ExtensionMessage,
    keys,
    layout::Size,
    modal::{Modal, Notice},
    tabs::Tab,
    widgets::text::{Canvas, fit_words, running, width},
};
use crate::{
    plant::{alarm::AlarmState, command::CommandKind, def::Subject},
    sim::{
        drill::SimCommand,
        faults::{FaultTarget, InjectedFault},
    },
    t,
    text::translate,
};

/// Leaves a task undone.
pub(super) const SKIP: keys::Chord = keys::ctrl('n');

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Task {
    Look,
    Set,
    Follow,
    Acknowledge,
    Guidance,
    Why,
    Past,
    Report,
}

impl Task {
    const ALL: [Task; 8] =
        [Task::Look, Task::Set, Task::Follow, Task::Acknowledge, Task::Guidance, Task::Why, Task::Past, Task::Report];

    fn message(self) -> &'static str {
        match self {
            Task::Look => "Look at a controller: select TIC-1 with the arrow keys, ⏎",
            Task::Set => "Set its temperature: Esc, s, type 60, ⏎ and ⏎ again",
            Task::Follow => "Follow it: 2 shows its curves, c a cursor that ← → move",
            Task::Acknowledge => "A device stops responding. Acknowledge its alarm: a",
            Task::Guidance => "What should be done about it? 3 lists alarms, ⏎ shows it",
            Task::Why => "Why is a value bad? Esc, 1, select one with arrow keys, w",
            Task::Past => "It responds again. Show the past: Esc, @, -20s, ⏎",
            Task::Report => "Export the report: Esc (the present), 5, e",
        }
    }

    /// The same where there is less room.
    fn brief(self) -> &'static str {
        match self {
            Task::Look => t!("Select TIC-1 with the arrow keys, ⏎"),
            Task::Set => t!("Esc, s, type 60, ⏎ and ⏎ again"),
            Task::Follow => t!("2 shows curves, c a cursor: ← →"),
            Task::Acknowledge => t!("A device is silent. Acknowledge: a"),
            Task::Guidance => t!("What to do? 3 lists alarms, ⏎"),
            Task::Why => t!("Why is it bad? Esc, 1, select one, w"),
            Task::Past => t!("Show the past: Esc, @, -20s, ⏎"),
            Task::Report => t!("Export the report: Esc, 5, e"),
        }
    }

    /// Is the terminal in the state that the task asks for?
    fn is_done(self, model: &Model, event: TourEvent) -> bool {
        match self {
            Task::Look => matches!(model.modal, Some(Modal::Faceplate(_))),
            Task::Set => is_written(model),
            Task::Follow => model.tabs.shown == Tab::Trends && model.tabs.shown().moment(&model.cx()).is_some(),
            Task::Acknowledge => is_acknowledged(model),
            Task::Guidance => matches!(model.modal, Some(Modal::Guidance(_))),
            Task::Why => matches!(model.modal, Some(Modal::Why(_))),
            Task::Past => model.replay.shown().is_some(),
            Task::Report => event == TourEvent::Saved,
        }
    }

    fn needs_silence(self) -> bool {
        matches!(self, Task::Acknowledge | Task::Guidance | Task::Why)
    }
}

/// How far an operator has come.
#[derive(Debug, Default)]
pub struct Tour {
    /// Ticks that each finished task took; `None` where it was left out.
    took: Vec<Option<u32>>,
    keys: u32,
    began_at: Option<u32>,
    silenced: bool,
}

/// Takes in what happened; called after every message.
pub(super) fn follow(model: &mut Model, event: TourEvent) -> Vec<UiAction> {
    let Some(mut tour) = model.tour.take() else { return Vec::new() };
    let phase = model.clock.phase;
    let began = *tour.began_at.get_or_insert(phase);
    tour.keys += u32::from(event == TourEvent::Key);
    if let Some(task) = tour.task() {
        let done = task.is_done(model, event);
        if done || event == TourEvent::Skip {
            tour.took.push(done.then(|| phase.wrapping_sub(began)));
            tour.began_at = Some(phase);
            if tour.task().is_none() {
                model.modal = Some(Modal::Notice(certificate(&tour)));
            }
        }
    }
    let actions = tour.fault(model);
    model.tour = Some(tour);
    actions
}

/// What the tour takes notice of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum TourEvent {
    Key,
    /// The operator leaves the task out.
    Skip,
    Saved,
    /// Anything else.
    Other,
}

impl TourEvent {
    /// What a message is to the tour.
    pub fn of(msg: &Msg) -> TourEvent {
        if let Msg::Key(event) = msg {
            return if SKIP.is(*event) { TourEvent::Skip } else { TourEvent::Key };
        }
        if matches!(msg, Msg::Saved(_, Ok(_))) { TourEvent::Saved } else { TourEvent::Other }
    }
}

impl Tour {
    fn task(&self) -> Option<Task> {
        Task::ALL.get(self.took.len()).copied()
    }

    /// The fault that a task needs, injected once and cleared after the last task that needs it.
    fn fault(&mut self, model: &Model) -> Vec<UiAction> {
        let silent = self.task().is_some_and(Task::needs_silence);
        if std::mem::replace(&mut self.silenced, silent) == silent {
            return Vec::new();
        }
        let Some(device) = model.snapshot.def.devices.first() else { return Vec::new() };
        let target = FaultTarget::Unit(device.line, device.unit);
        let command = match silent {
            true => SimCommand::Inject(target, InjectedFault::Silent),
            false => SimCommand::Clear(target, InjectedFault::Silent),
        };
        vec![UiAction::Do(Effect::Extension(ExtensionMessage::new(command)))]
    }

    /// The present task over the line above the tab; at its right end while the past stands in it.
    pub(super) fn view(&self, cx: &ViewContext, canvas: &mut Canvas) {
        let Some(task) = self.task() else { return };
        let [message, brief] = [translate(task.message()), task.brief()].map(|words| cx.theme.enter(words));
        let place = format!("{}/{}", self.took.len() + 1, Task::ALL.len());
        let (room, next) = (canvas.width().saturating_sub(2), t!("Ctrl-N: next"));
        let words = match cx.size {
            // The tasks lead to what a smaller screen does not show.
            Size::Tiny | Size::Compact => vec![t!(" TOUR: needs 60x16 ").to_owned()],
            Size::Narrow | Size::Normal | Size::Wide | Size::Overview => vec![
                t!(" TOUR {place}  {message}   ({next}) ", place, message, next),
                format!(" {place}  {message}  {next} "),
                format!(" {place}  {brief}  {next} "),
            ],
        };
        let fits = words.iter().find(|words| width(words) <= room).cloned();
        let words = fits.unwrap_or_else(|| fit_words(&format!(" {brief} "), room));
        canvas.text_right(canvas.width().saturating_sub(1), 0, &words, cx.theme.focus());
    }
}

/// Is a write of this terminal verified?
fn is_written(model: &Model) -> bool {
    let status = model.last_command.as_ref().and_then(|last| last.status.as_ref());
    status.is_some_and(|status| matches!(status.command.kind, CommandKind::Write { .. }) && status.outcome.is_done())
}

/// Is the alarm of a device acknowledged?
fn is_acknowledged(model: &Model) -> bool {
    model.snapshot.alarms.iter().any(|alarm| {
        let subject = model.snapshot.def.alarm(alarm.id).subject;
        alarm.state == AlarmState::Acknowledged && matches!(subject, Subject::Device(_))
    })
}

/// What was done, and how long it took.
fn certificate(tour: &Tour) -> Notice {
    let spent = |ticks: u32| running(TICK * ticks);
    let rows = Task::ALL.iter().zip(&tour.took).map(|(task, took)| {
        let message = translate(task.message());
        match took {
            Some(ticks) => t!("✓ {time} {message}", time = spent(*ticks), message),
            None => t!("– left out: {message}", message),
        }
    });
    let done: Vec<u32> = tour.took.iter().flatten().copied().collect();
    let sum = t!(
        "{done} of {count} tasks in {time}, with {keys} keys",
        done = done.len(),
        count = Task::ALL.len(),
        time = spent(done.iter().sum()),
        keys = tour.keys
    );
    let more = t!("P saves this page. ? lists the keys of every tab, : goes to anything by its name.").to_owned();
    Notice::list(t!("Tour finished"), rows.chain([String::new(), sum, more]).collect())
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::ui::{
        fixture::Fixture,
        tests::{model, screen, type_keys},
        theme::Theme,
        update,
    };

    fn begun(fixture: &Fixture) -> Model {
        let mut model = model(fixture, Theme::FULL);
        model.tour = Some(Tour::default());
        update(&mut model, Msg::Tick { silent: Duration::ZERO });
        model
    }

    fn task(model: &Model) -> Option<Task> {
        model.tour.as_ref().and_then(Tour::task)
    }

    fn faults(effects: &[Effect]) -> Vec<SimCommand> {
        let of = |effect: &Effect| match effect {
            Effect::Extension(message) => message.get::<SimCommand>().copied(),
            _ => None,
        };
        effects.iter().filter_map(of).collect()
    }

    #[test]
    fn a_task_is_shown_until_it_is_done() {
        let mut model = begun(&Fixture::normal());
        assert!(screen(&mut model, 80, 24).contains(" 1/8  Look at a controller"));
        type_keys(&mut model, "→⏎");
        assert_eq!(task(&model), Some(Task::Set), "its faceplate was opened");
        type_keys(&mut model, "⎋2c");
        assert_eq!(task(&model), Some(Task::Set), "a later task does not count before its turn");
        assert!(screen(&mut model, 160, 50).contains("TOUR 2/8  Set its temperature"));
    }

    #[test]
    fn every_task_and_the_way_on_fit_at_every_size() {
        let mut model = begun(&Fixture::normal());
        for task in Task::ALL {
            for (width, height, message) in
                [(160, 50, task.message()), (80, 24, task.message()), (60, 20, task.brief())]
            {
                let shown = screen(&mut model, width, height);
                let row = shown.lines().find(|row| row.contains(message)).unwrap_or_default();
                assert!(row.contains("Ctrl-N: next"), "{task:?} at {width}x{height}:\n{shown}");
            }
            assert!(screen(&mut model, 40, 12).contains("TOUR: needs 60x16"));
            update(&mut model, Msg::Key(SKIP.event()));
        }
        let last = screen(&mut model, 80, 24);
        assert!(last.contains("Tour finished") && last.contains("0 of 8 tasks in 00:00, with 0 keys"), "{last}");
    }

    #[test]
    fn a_device_is_silent_for_the_tasks_that_need_it() {
        let mut model = begun(&Fixture::normal());
        let skip = |model: &mut Model| faults(&update(model, Msg::Key(SKIP.event())));
        assert_eq!((skip(&mut model), skip(&mut model)), (Vec::new(), Vec::new()));
        let injected = skip(&mut model);
        assert!(matches!(injected[..], [SimCommand::Inject(_, InjectedFault::Silent)]), "{injected:?}");
        assert_eq!((skip(&mut model), skip(&mut model)), (Vec::new(), Vec::new()));
        let cleared = skip(&mut model);
        assert!(matches!(cleared[..], [SimCommand::Clear(_, InjectedFault::Silent)]), "{cleared:?}");
        assert_eq!(task(&model), Some(Task::Past));
    }

    #[test]
    fn the_last_page_tells_what_was_done_and_left_out() {
        let mut model = begun(&Fixture::normal());
        type_keys(&mut model, "→⏎");
        for _ in 0..7 {
            update(&mut model, Msg::Tick { silent: Duration::ZERO });
            update(&mut model, Msg::Key(SKIP.event()));
        }
        let last = screen(&mut model, 120, 40);
        assert!(last.contains("✓ 00:00 Look at a controller") && last.contains("1 of 8 tasks in"), "{last}");
        assert!(last.contains("– left out: Export the report"), "{last}");
        type_keys(&mut model, "⎋");
        assert!(!screen(&mut model, 80, 24).contains("TOUR"), "nothing of it is left");
    }
}
