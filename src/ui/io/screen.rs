//! The terminal device: raised once, restored exactly once on every way out, written to in whole frames.

use std::{
    cell::Cell as Flag,
    io::{self, IsTerminal, Write},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
};

use crossterm::{
    clipboard::CopyToClipboard,
    cursor, event,
    style::{Attribute, Print, SetAttribute},
    terminal,
};
use ratatui::{Frame, Terminal, backend::Backend};
use tokio::time::Instant;

use super::{frame_backend::FrameBackend, question};
use crate::ui::graphics::{Picture, Protocol, kitty};

/// The terminal is in raw mode and shows our screen.
static RAISED: AtomicBool = AtomicBool::new(false);
/// It holds a picture of ours.
static PICTURED: AtomicBool = AtomicBool::new(false);

thread_local! {
    /// This thread is inside the terminal's own code: a panic now is the terminal's.
    static OWN: Flag<bool> = const { Flag::new(false) };
}

/// A raised terminal. Dropping it restores what was there before.
pub struct Screen {
    terminal: Terminal<FrameBackend>,
    /// The terminal reports the mouse.
    mouse: bool,
    /// When it was asked about pictures, if it was.
    pub asked_at: Option<Instant>,
}

impl Screen {
    /// Is there a terminal that can be drawn on?
    pub fn exists() -> bool {
        let dumb = std::env::var("TERM").is_ok_and(|term| term == "dumb");
        io::stdin().is_terminal() && io::stdout().is_terminal() && !dumb
    }

    /// Raw mode, own screen, no cursor, pastes marked as such; from now on a panic restores the terminal first.
    /// What a terminal prints of a question that it does not know is cleared with the rest.
    pub fn raise(asks: bool) -> io::Result<Screen> {
        hook_panics();
        // The theme decides about colour. Left to itself crossterm answers NO_COLOR with sequences that switch attributes off.
        crossterm::style::force_color_output(true);
        terminal::enable_raw_mode()?;
        RAISED.store(true, Ordering::SeqCst);
        let asked_at = asks.then(Instant::now);
        let question = if asks { question::question() } else { Vec::new() };
        let raised = crossterm::execute!(
            io::stdout(),
            terminal::EnterAlternateScreen,
            Print(String::from_utf8_lossy(&question)),
            // A console without an alternate screen keeps what was there.
            terminal::Clear(terminal::ClearType::All),
            cursor::Hide,
            event::EnableBracketedPaste
        );
        let screen =
            raised.and_then(|()| Ok(Screen { terminal: Terminal::new(FrameBackend::new()?)?, mouse: false, asked_at }));
        if screen.is_err() {
            restore();
        }
        screen
    }

    /// Draws one frame and sends it in one piece; sends nothing when nothing has changed.
    pub fn draw(&mut self, view: impl FnOnce(&mut Frame)) -> io::Result<()> {
        own(|| self.terminal.draw(view))?;
        self.terminal.backend_mut().send()
    }

    /// The size changed, or the screen was spoiled by others: the next frame is drawn from nothing.
    pub fn renew(&mut self) -> io::Result<()> {
        self.terminal.backend_mut().measure()?;
        let area = self.terminal.backend().size()?;
        self.terminal.resize(ratatui::layout::Rect::new(0, 0, area.width, area.height))
    }

    /// Shows a picture, which is encoded as these bytes, over the cells, in place of the one before.
    pub fn paint(&mut self, picture: &Picture, bytes: &[u8]) -> io::Result<()> {
        PICTURED.store(picture.protocol == Protocol::Kitty, Ordering::SeqCst);
        let wire = self.terminal.backend_mut();
        crossterm::queue!(wire.bytes, cursor::MoveTo(picture.area.x, picture.area.y))?;
        wire.bytes.extend(bytes);
        wire.send()
    }

    /// Takes the picture away: the next frame is drawn from nothing.
    pub fn clear_picture(&mut self) -> io::Result<()> {
        if PICTURED.swap(false, Ordering::SeqCst) {
            self.terminal.backend_mut().bytes.extend(kitty::DELETE);
        }
        self.renew()
    }

    pub fn ring(&mut self) -> io::Result<()> {
        let wire = self.terminal.backend_mut();
        wire.bytes.push(0x07);
        wire.send()
    }

    /// Has the terminal report the mouse, or select text by itself.
    pub fn set_mouse(&mut self, on: bool) -> io::Result<()> {
        if self.mouse == on {
            return Ok(());
        }
        self.mouse = on;
        let wire = self.terminal.backend_mut();
        // Clicks, drags and the wheel; not every movement, as crossterm asks for.
        wire.bytes.extend(if on { b"\x1b[?1000h\x1b[?1002h\x1b[?1006h" } else { b"\x1b[?1006l\x1b[?1002l\x1b[?1000l" });
        wire.send()
    }

    /// Puts a text into the clipboard of the terminal, also over SSH (OSC 52). A terminal that cannot ignores it.
    pub fn copy(&mut self, text: &str) -> io::Result<()> {
        let wire = self.terminal.backend_mut();
        crossterm::execute!(wire.bytes, CopyToClipboard::to_clipboard_from(text))?;
        wire.send()
    }

    /// Columns and rows.
    pub fn size(&self) -> (u16, u16) {
        let size = self.terminal.backend().size;
        (size.width, size.height)
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        restore();
    }
}

/// Runs the terminal's own code: a panic inside restores the terminal, a panic anywhere else does not.
pub fn own<T>(work: impl FnOnce() -> T) -> T {
    struct Reset;
    impl Drop for Reset {
        fn drop(&mut self) {
            OWN.with(|flag| flag.set(false));
        }
    }
    OWN.with(|flag| flag.set(true));
    let _reset = Reset;
    work()
}

/// Puts everything back, the first time it is called. Errors are of no use to anyone: the terminal may be gone.
fn restore() {
    if RAISED.swap(false, Ordering::SeqCst) {
        if PICTURED.swap(false, Ordering::SeqCst) {
            let _ = io::stdout().write_all(kitty::DELETE);
        }
        let _ = crossterm::execute!(
            io::stdout(),
            event::DisableMouseCapture,
            event::DisableBracketedPaste,
            SetAttribute(Attribute::Reset),
            terminal::LeaveAlternateScreen,
            cursor::Show
        );
        let _ = terminal::disable_raw_mode();
    }
}

/// A panic of the terminal's own code restores the terminal and is printed; any other, while our screen is up, is only logged.
fn hook_panics() {
    static HOOKED: AtomicBool = AtomicBool::new(false);
    if HOOKED.swap(true, Ordering::SeqCst) {
        return;
    }
    let before = Arc::new(std::panic::take_hook());
    std::panic::set_hook(Box::new(move |info| {
        if OWN.with(Flag::get) {
            restore();
        }
        if RAISED.load(Ordering::SeqCst) {
            tracing::error!("{info}");
        } else {
            before(info);
        }
    }));
}
