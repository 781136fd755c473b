//! Where the keys of an alarm lead.

use super::*;

impl Alarms {
    pub(super) fn ask_text(&self) -> Vec<UiAction> {
        let prompt = match self.page {
            Page::Journal => Prompt::new(t!("search the journal"), journal::FORMS, &self.journal.typed()),
            Page::Active | Page::Suppressed | Page::System | Page::Metrics | Page::Handover => {
                Prompt::new(t!("show only alarms with"), filter::FORMS, &self.filter.typed())
            }
        };
        open(Modal::Prompt(prompt))
    }

    /// Leads to what the alarm watches.
    pub(super) fn go(&self, cx: &ViewContext, action: Action) -> Vec<UiAction> {
        let Some(id) = self.target(cx) else { return Vec::new() };
        let raised = self.selected(cx).map_or(cx.now, |alarm| alarm.raised_at);
        match (cx.def().alarm(id).subject, action) {
            (Subject::Tag(tag), Action::Mimic) => vec![UiAction::ShowOnMimic(vec![tag])],
            (Subject::Device(device), Action::Mimic) => {
                vec![UiAction::ShowOnMimic(cx.def().tags_of(device).map(|tag| tag.id).collect())]
            }
            (Subject::Tag(tag), Action::Trend) => vec![UiAction::ShowOnTrends(tag, (raised, raised))],
            (Subject::Tag(tag), Action::Controller) => vec![UiAction::ShowParameter(tag)],
            (Subject::Device(device), Action::Controller) => vec![UiAction::ShowDevice(device)],
            (Subject::Tag(tag), Action::Why) => Why::open(Why::new(vec![tag], 0)),
            (Subject::Device(device), Action::Why) => Why::open(Why::of_device(cx, device)),
            (subject, Action::Open) => open(Modal::Guidance(Box::new(Guidance::new(id, faceplate(cx, subject))))),
            (Subject::Tag(_) | Subject::Device(_) | Subject::Line(_) | Subject::Station, _) => Vec::new(),
        }
    }
}

/// The faceplate of what an alarm watches.
pub fn faceplate(cx: &ViewContext, subject: Subject) -> Option<Faceplate> {
    match subject {
        Subject::Tag(tag) => Faceplate::new(cx.def().tag(tag).label.clone(), vec![tag]),
        Subject::Device(device) => {
            let tags = cx.def().tags_of(device).take(8).map(|tag| tag.id).collect();
            Faceplate::new(format!("{} {}", cx.def().device(device).name, device_text(cx, device)), tags)
        }
        Subject::Line(_) | Subject::Station => None,
    }
}
