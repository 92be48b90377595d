//! The terminal: drawn ten times a second, given back on every way out.

use std::io::{self, ErrorKind};
use std::time::{Duration, Instant};

use crossterm::event::{self, Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use ratatui::DefaultTerminal;
use vigil_cycle::signal;

use super::document;
use super::frame;
use super::palette::Palette;
use super::scene::Scene;
use crate::watch::{POLL, Watch};

/// Between two pictures.
const DRAW: Duration = Duration::from_millis(100);
/// Time that an orderly end may take.
const END: Duration = Duration::from_secs(1);
/// Events that a page key scrolls by.
const PAGE: usize = 5;

/// A terminal in our hands. It goes back when this is dropped; after a panic before its message,
/// by the hook that the library installs.
struct Screen {
    terminal: DefaultTerminal,
}

impl Screen {
    fn take() -> io::Result<Self> {
        let terminal = ratatui::try_init()?;
        Ok(Self { terminal })
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        // What cannot be given back is gone.
        let _ = self.terminal.show_cursor();
        let _ = ratatui::try_restore();
    }
}

/// What keys have changed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct Look {
    scroll: usize,
    has_help: bool,
    has_quit: bool,
}

impl Look {
    fn press(&mut self, key: KeyEvent, events: usize) {
        let is_control = key.modifiers.contains(KeyModifiers::CONTROL);
        let most = events.saturating_sub(1);
        match key.code {
            KeyCode::Char('c') if is_control => self.has_quit = true,
            KeyCode::Char('q') | KeyCode::Esc => self.has_quit = true,
            KeyCode::Char('?' | 'h') => self.has_help = !self.has_help,
            KeyCode::Up => self.scroll = (self.scroll + 1).min(most),
            KeyCode::PageUp => self.scroll = (self.scroll + PAGE).min(most),
            KeyCode::Down => self.scroll = self.scroll.saturating_sub(1),
            KeyCode::PageDown => self.scroll = self.scroll.saturating_sub(PAGE),
            KeyCode::End => self.scroll = 0,
            _ => {}
        }
    }
}

/// Draws a graph until somebody quits or a signal comes.
///
/// # Errors
/// The terminal's.
pub fn run(watch: &mut Watch, palette: Palette) -> io::Result<()> {
    end_in_time();
    let mut screen = Screen::take()?;
    let mut look = Look::default();
    let mut drawn: Option<Instant> = None;
    while !(signal::stop_requested() || look.has_quit) {
        watch.look();
        if drawn.is_none_or(|drawn| drawn.elapsed() >= DRAW) {
            drawn = Some(Instant::now());
            let document = document(watch);
            let scene = Scene {
                scroll: look.scroll,
                has_help: look.has_help,
                ..Scene::new(&document, &watch.view, palette)
            };
            let draw = |frame: &mut ratatui::Frame<'_>| {
                frame::draw(&scene, frame.area(), frame.buffer_mut());
            };
            screen.terminal.draw(draw)?;
        }
        match next_event()? {
            Some(Event::Key(key)) if key.kind != KeyEventKind::Release => {
                look.press(key, watch.view.events.len());
                drawn = None;
            }
            Some(Event::Resize(..)) => drawn = None,
            _ => {}
        }
    }
    Ok(())
}

/// Ends this process soon after it was asked to, whatever it is at: the library does not come back
/// from reading a terminal that is gone.
fn end_in_time() {
    std::thread::spawn(|| {
        while !signal::stop_requested() {
            std::thread::sleep(DRAW);
        }
        std::thread::sleep(END);
        std::process::exit(1);
    });
}

/// The wait between two looks: a key ends it, and a signal, which is no error.
fn next_event() -> io::Result<Option<Event>> {
    let next = || match event::poll(POLL)? {
        true => event::read().map(Some),
        false => Ok(None),
    };
    match next() {
        Err(error) if error.kind() == ErrorKind::Interrupted => Ok(None),
        next => next,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_quit_explain_and_scroll_within_the_events() {
        let press = |look: &mut Look, code, modifiers| {
            look.press(KeyEvent::new(code, modifiers), 3);
            *look
        };
        let (none, control) = (KeyModifiers::NONE, KeyModifiers::CONTROL);
        let mut look = Look::default();
        assert!(press(&mut look, KeyCode::Char('h'), none).has_help);
        assert!(!press(&mut look, KeyCode::Char('?'), none).has_help);
        let most = (0..9).map(|_| press(&mut look, KeyCode::Up, none).scroll);
        assert_eq!(most.max(), Some(2));
        assert_eq!(press(&mut look, KeyCode::PageDown, none).scroll, 0);
        // Nothing is acknowledged by a key.
        let before = look;
        assert_eq!(press(&mut look, KeyCode::Char('a'), none), before);
        assert!(!press(&mut look, KeyCode::Char('c'), none).has_quit);
        for (code, modifiers) in [
            (KeyCode::Char('q'), none),
            (KeyCode::Esc, none),
            (KeyCode::Char('c'), control),
        ] {
            assert!(press(&mut Look::default(), code, modifiers).has_quit);
        }
    }
}
