//! `tandem top`: a running cell, looked at several times a second.

mod draw;

use std::io::IsTerminal as _;
use std::time::{Duration, Instant};

use clap::Args;
use ratatui::crossterm::event::{self, Event, KeyCode, KeyEventKind, KeyModifiers};
use tandem_cycle::{Clock as _, Monotonic};

use super::{exit, status};
use crate::observe::Observer;

#[derive(Args)]
pub(super) struct TopArgs {
    /// Cell file, cell or instance; may be left out when one cell is running
    cell: Option<String>,
    /// Looks a second
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=100))]
    hertz: u32,
}

/// Why the screen was left.
enum Left {
    Asked,
    Ended,
}

pub(super) fn top(args: &TopArgs) -> u8 {
    if !std::io::stdout().is_terminal() {
        anstream::eprintln!("tandem top draws on a terminal; `tandem status --json` is for scripts");
        return exit::USAGE;
    }
    let mut observer = match status::open(args.cell.as_deref()) {
        Ok(observer) => observer,
        Err(code) => return code,
    };
    let screen = ratatui::try_init();
    let left = screen.and_then(|terminal| watch(terminal, &mut observer, Duration::from_secs(1) / args.hertz));
    ratatui::restore();
    match left {
        Ok(Left::Asked) => exit::OK,
        Ok(Left::Ended) => {
            anstream::eprintln!("the cell has ended");
            exit::OK
        }
        Err(error) => {
            anstream::eprintln!("the terminal: {error}");
            exit::FAILED
        }
    }
}

fn watch(mut terminal: ratatui::DefaultTerminal, observer: &mut Observer, between: Duration) -> std::io::Result<Left> {
    loop {
        let next = Instant::now() + between;
        let view = observer.look(Monotonic.now());
        terminal.draw(|frame| draw::draw(frame, &view))?;
        while event::poll(next.saturating_duration_since(Instant::now()))? {
            if asks_to_leave(&event::read()?) {
                return Ok(Left::Asked);
            }
        }
        if !observer.is_running() {
            return Ok(Left::Ended);
        }
    }
}

fn asks_to_leave(event: &Event) -> bool {
    let Event::Key(key) = event else { return false };
    let interrupt = key.code == KeyCode::Char('c') && key.modifiers.contains(KeyModifiers::CONTROL);
    key.kind == KeyEventKind::Press && (matches!(key.code, KeyCode::Char('q') | KeyCode::Esc) || interrupt)
}
