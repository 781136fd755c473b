//! Where the keys of an alarm lead.

use super::*;

impl Alarms {
    pub(super) fn ask_search(&mut self, _cx: &ViewContext) -> Vec<UiAction> {
        open(Modal::Prompt(Prompt::new(t!("search the journal"), journal::FORMS, &self.journal.filter())))
    }

    /// What the alarm watches that the keys of the page are about.
    fn subject(&self, cx: &ViewContext) -> Option<Subject> {
        self.target(cx).map(|id| cx.def().alarm(id).subject)
    }

    /// Acknowledges with a note: the marked ones, else the selected one.
    pub(super) fn note(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        let marked = self.marked(cx);
        match self.selected(cx) {
            _ if !marked.is_empty() => actions::acknowledge_all(cx, marked.into_iter(), true),
            alarm => alarm.map_or_else(Vec::new, |alarm| actions::note(cx, alarm)),
        }
    }

    pub(super) fn open_guidance(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        let guidance = |id| Guidance::new(id, Faceplate::of(cx, cx.def().alarm(id).subject));
        open(self.target(cx).map(|id| Modal::Guidance(Box::new(guidance(id)))))
    }

    pub(super) fn show_on_mimic(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        let tags = match self.subject(cx) {
            Some(Subject::Tag(tag)) => vec![tag],
            Some(Subject::Device(device)) => cx.def().tags_of(device).map(|tag| tag.id).collect(),
            Some(Subject::Line(_) | Subject::Station) | None => return Vec::new(),
        };
        vec![UiAction::ShowOnMimic(tags)]
    }

    pub(super) fn show_trend(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        let Some(Subject::Tag(tag)) = self.subject(cx) else { return Vec::new() };
        let raised = self.selected(cx).map_or(cx.now, |alarm| alarm.raised_at);
        vec![UiAction::ShowOnTrends(tag, (raised, raised))]
    }

    pub(super) fn show_controller(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        match self.subject(cx) {
            Some(Subject::Tag(tag)) => vec![UiAction::ShowParameter(tag)],
            Some(Subject::Device(device)) => vec![UiAction::ShowDevice(device)],
            Some(Subject::Line(_) | Subject::Station) | None => Vec::new(),
        }
    }

    pub(super) fn why(&mut self, cx: &ViewContext) -> Vec<UiAction> {
        Why::open(match self.subject(cx) {
            Some(Subject::Tag(tag)) => Why::new(vec![tag], 0),
            Some(Subject::Device(device)) => Why::of_device(cx, device),
            Some(Subject::Line(_) | Subject::Station) | None => None,
        })
    }
}
