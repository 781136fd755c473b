//! The extension point of the terminal: state that the embedding command adds, shown in the header and on a tab of its
//! own. The simulator of `demo` is one; at a real plant there is none.

use std::{any::Any, fmt::Debug, sync::Arc};

use ratatui::style::Style;

use super::theme::Theme;

/// The state of an extension.
pub trait Extension: Any + Debug + Send + Sync {
    /// Parts of the header, each with its rank: the greatest is left out first.
    fn header(&self, theme: &Theme) -> Vec<(usize, String, Style)>;

    /// Is its tab offered?
    fn has_tab(&self) -> bool;
}

/// The state of the extension, if it is of this type.
pub fn state<T: Extension>(extension: Option<&dyn Extension>) -> Option<&T> {
    let state: &dyn Any = extension?;
    state.downcast_ref()
}

/// A message from the tab of an extension to the command that added it.
#[derive(Debug, Clone)]
pub struct ExtensionMessage(Arc<dyn Any + Send + Sync>);

impl ExtensionMessage {
    /// Wraps a message.
    pub fn new(message: impl Any + Send + Sync) -> ExtensionMessage {
        ExtensionMessage(Arc::new(message))
    }

    /// The message, if it is of this type.
    pub fn get<T: Any>(&self) -> Option<&T> {
        self.0.downcast_ref()
    }
}

impl PartialEq for ExtensionMessage {
    /// Messages of unknown types are equal only to themselves.
    fn eq(&self, other: &ExtensionMessage) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}
