//! The terminal device: raised once, restored exactly once on every way out, written to in whole frames.

use std::{
    cell::Cell as Flag,
    io::{self, IsTerminal, Write},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
};

use crossterm::{clipboard::CopyToClipboard, cursor, event, terminal};
use ratatui::{
    Frame, Terminal,
    backend::{Backend, ClearType, CrosstermBackend, WindowSize},
    buffer::Cell,
    layout::{Position, Size},
};

/// The terminal is in raw mode and shows our screen.
static RAISED: AtomicBool = AtomicBool::new(false);

thread_local! {
    /// This thread is inside the terminal's own code: a panic now is the terminal's.
    static OWN: Flag<bool> = const { Flag::new(false) };
}

/// What a frame ends with, and the shorter words for the same.
const TAIL: (&[u8], &[u8]) = (b"\x1b[39m\x1b[49m\x1b[59m\x1b[0m", b"\x1b[0m");
/// Smaller frames cannot tear and are sent without the brackets of synchronized output.
const TEAR_BYTES: usize = 96;

/// A raised terminal. Dropping it restores what was there before.
pub struct Screen {
    terminal: Terminal<Wire>,
    /// The terminal reports the mouse.
    mouse: bool,
}

impl Screen {
    /// Is there a terminal that can be drawn on?
    pub fn exists() -> bool {
        let dumb = std::env::var("TERM").is_ok_and(|term| term == "dumb");
        io::stdin().is_terminal() && io::stdout().is_terminal() && !dumb
    }

    /// Raw mode, own screen, no cursor, pastes marked as such; from now on a panic restores the terminal first.
    pub fn raise() -> io::Result<Screen> {
        hook_panics();
        // The theme decides about colour. Left to itself crossterm answers NO_COLOR with sequences that switch attributes off.
        crossterm::style::force_color_output(true);
        terminal::enable_raw_mode()?;
        RAISED.store(true, Ordering::SeqCst);
        let raised = crossterm::execute!(
            io::stdout(),
            terminal::EnterAlternateScreen,
            // A console without an alternate screen keeps what was there.
            terminal::Clear(terminal::ClearType::All),
            cursor::Hide,
            event::EnableBracketedPaste
        );
        let screen = raised.and_then(|()| Ok(Screen { terminal: Terminal::new(Wire::new()?)?, mouse: false }));
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

    /// Rings the bell of the terminal.
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
        let _ = crossterm::execute!(
            io::stdout(),
            event::DisableMouseCapture,
            event::DisableBracketedPaste,
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

/// A backend that gathers a frame's bytes, so that they travel in one write and an unchanged frame costs nothing.
/// It asks the terminal nothing: an answer would arrive among the keys.
struct Wire {
    bytes: Vec<u8>,
    size: Size,
}

impl Wire {
    fn new() -> io::Result<Wire> {
        let mut wire = Wire { bytes: Vec::new(), size: Size::default() };
        wire.measure()?;
        Ok(wire)
    }

    fn measure(&mut self) -> io::Result<()> {
        let (width, height) = terminal::size()?;
        self.size = Size::new(width, height);
        Ok(())
    }

    fn send(&mut self) -> io::Result<()> {
        if self.bytes.is_empty() {
            return Ok(());
        }
        let frame = framed(&self.bytes);
        self.bytes.clear();
        let mut out = io::stdout().lock();
        out.write_all(&frame)?;
        out.flush()
    }
}

/// The bytes of a frame as they are sent: in synchronized output unless it is tiny, with the shorter tail.
fn framed(bytes: &[u8]) -> Vec<u8> {
    let body = bytes.strip_suffix(TAIL.0).map_or_else(|| bytes.to_vec(), |body| [body, TAIL.1].concat());
    if body.len() < TEAR_BYTES { body } else { [b"\x1b[?2026h".as_slice(), &body, b"\x1b[?2026l"].concat() }
}

impl Backend for Wire {
    type Error = io::Error;

    fn draw<'a, I>(&mut self, content: I) -> io::Result<()>
    where
        I: Iterator<Item = (u16, u16, &'a Cell)>,
    {
        let mut content = content.peekable();
        if content.peek().is_none() {
            return Ok(());
        }
        CrosstermBackend::new(&mut self.bytes).draw(content)
    }
    fn hide_cursor(&mut self) -> io::Result<()> {
        Ok(())
    }
    fn show_cursor(&mut self) -> io::Result<()> {
        Ok(())
    }
    fn get_cursor_position(&mut self) -> io::Result<Position> {
        Ok(Position::ORIGIN)
    }
    fn set_cursor_position<P: Into<Position>>(&mut self, _position: P) -> io::Result<()> {
        Ok(())
    }
    fn clear(&mut self) -> io::Result<()> {
        CrosstermBackend::new(&mut self.bytes).clear()
    }
    fn clear_region(&mut self, region: ClearType) -> io::Result<()> {
        CrosstermBackend::new(&mut self.bytes).clear_region(region)
    }
    fn size(&self) -> io::Result<Size> {
        Ok(self.size)
    }
    fn window_size(&mut self) -> io::Result<WindowSize> {
        Ok(WindowSize { columns_rows: self.size, pixels: Size::default() })
    }
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_second_of_the_clock_costs_few_bytes() {
        let mut wire = Wire { bytes: Vec::new(), size: Size::new(80, 24) };
        let mut cell = Cell::default();
        cell.set_char('7');
        wire.draw([(77, 0, &cell)].into_iter()).expect("a vector takes every byte");
        let frame = framed(&wire.bytes);
        assert!(frame.len() < 20, "{} bytes", frame.len());
        wire.bytes.clear();
        wire.draw(std::iter::empty()).expect("a vector takes every byte");
        assert!(wire.bytes.is_empty(), "an unchanged frame is not sent");
    }

    #[test]
    fn without_colour_no_colour_byte_is_sent() {
        let mut wire = Wire { bytes: Vec::new(), size: Size::new(80, 24) };
        let mut cell = Cell::default();
        cell.set_char('x').set_style(crate::ui::theme::Theme::PLAIN.focus());
        wire.draw([(0, 0, &cell)].into_iter()).expect("a vector takes every byte");
        let sent = String::from_utf8(framed(&wire.bytes)).expect("text");
        assert!(sent.contains("\x1b[7m") && sent.contains("\x1b[1m"), "reverse and bold stay: {sent:?}");
        assert!(!sent.contains("\x1b[3") && !sent.contains("\x1b[4"), "{sent:?}");
    }
}
