//! Nothing is done in the past: which actions and windows are refused.

use crate::{
    t,
    ui::{
        Model, UiAction,
        modal::{Modal, Scope},
    },
};

/// While the past is shown no command is given, and no form for one is opened.
pub(in crate::ui) fn refuse_commands(model: &mut Model, actions: Vec<UiAction>) -> Vec<UiAction> {
    if model.replay.shown().is_none() {
        return actions;
    }
    let count = actions.len();
    let is_command = |action: &UiAction| match action.scope() {
        Scope::Plant => true,
        Scope::Window(modal) => gives_command(modal),
        Scope::View | Scope::Files | Scope::Station => false,
    };
    let rest: Vec<UiAction> = actions.into_iter().filter(|action| !is_command(action)).collect();
    if rest.len() < count {
        model.note = Some(refused().into());
    }
    rest
}

/// Does a command come of this window? A form about users, as the password of a locked terminal, is not about the plant.
pub(in crate::ui) fn gives_command(modal: &Modal) -> bool {
    !modal.only_looks() && !matches!(modal, Modal::UserForm(_))
}

/// Said of a key that would give a command.
pub(in crate::ui) fn refused() -> &'static str {
    t!("This is the past: no commands. Esc returns to the present")
}
