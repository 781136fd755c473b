//! What almost every tab works with: what it is given, what it answers, how it draws, and the keys and lists of all tabs.

pub(super) use std::{borrow::Cow, time::Duration};

pub(super) use crossterm::event::{KeyCode, KeyEvent};
pub(super) use jiff::{SignedDuration, Timestamp};
pub(super) use ratatui::{
    Frame,
    layout::{Position, Rect},
    style::Style,
};

pub(super) use super::{
    KeyTable, Keyed, Rows, Tab, TabView,
    draw::{self, around, open, row_style},
    listing::{self, Column, Heading, List, ListPage, Listing, fitted, left, rest, right},
    periodic_query::{Answered, Asked, FromAnswer, PeriodicQuery, Queries, real},
    reports::period,
};
pub(super) use crate::{
    history::{Answer, HistoryError, Query},
    plant::{
        command::CommandKind,
        def::{DeviceDef, DeviceId, LineDef, LineId, ProcedureId, TagId},
        exact::{Exact, digits},
        line_state::DeviceState,
        number::to_u16,
        role::Role,
        snapshot::Snapshot,
        time::elapsed,
    },
    t,
    text::{of_plant, translate},
    ui::{
        UiAction, ViewContext,
        key_table::{self, Below, Keys, Offer, motions},
        keys::{self, Hint, char, code},
        modal::{Confirm, Faceplate, Modal, Notice, Prompt, Why, guidance::text as guidance_text},
        widgets::{
            list::{self, Motion, Scroll, Selected, Words, first, on_screen},
            text::{self, Canvas, clock, fit, fit_words, moment, pad, pad_left, running, width, wrap},
            value,
        },
    },
};
