//! The screen of `tandem top`.

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout};
use ratatui::style::{Color, Modifier, Style, Stylize as _};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Paragraph, Row, Table, Wrap};

use crate::cli::status::{COLUMNS, arm, motion, row, set_up, step};
use crate::observe::{LoopView, View};

/// Heights of a bar, from nothing to full.
const BARS: [char; 9] = [' ', '▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
/// What stands below the bars of lateness: the lower end of every fourth octave.
const AXIS: &str = "0 1µs     16µs    256µs   4ms";
/// A bar and a space.
const BAR_WIDTH: usize = 2;

/// Draws a look at a cell; what does not fit is cut.
pub(super) fn draw(frame: &mut Frame<'_>, view: &View) {
    let loops = view.loops.len() as u16;
    let inputs: u16 = view.loops.iter().map(|one| u16::from(!one.inputs.is_empty())).sum();
    let [head, table, bars, ages, set_ups] = Layout::vertical([
        Constraint::Length(5),
        Constraint::Length(loops + 3),
        Constraint::Length(loops + 3),
        // One line is longer than most screens are wide.
        Constraint::Length(inputs + 3),
        Constraint::Min(loops + 2),
    ])
    .areas(frame.area());
    let title = format!(" tandem top: {} ", view.instance);
    frame.render_widget(headline(view).block(Block::bordered().title(title).title_bottom(" q quits ")), head);
    frame.render_widget(
        figures(view).block(Block::bordered().title(" loops, since their start; the last three a cycle ")),
        table,
    );
    frame.render_widget(
        lateness(view).block(Block::bordered().title(" wake-ups by lateness; recent p50, p99, max ")),
        bars,
    );
    frame.render_widget(input_ages(view).block(Block::bordered().title(" age of inputs, p50 / p99 / max, ms ")), ages);
    frame.render_widget(obtained(view).block(Block::bordered().title(" realtime set-up in force ")), set_ups);
}

fn headline(view: &View) -> Paragraph<'_> {
    let stopped = view.motion.as_ref().is_some_and(|motion| motion.stop != "running");
    let braked = view.arm.as_ref().is_some_and(|arm| arm.fault != "none");
    let or = |line: Option<String>, absent: &'static str| line.unwrap_or_else(|| absent.to_owned());
    Paragraph::new(vec![
        Line::from(or(step(view), "no box has begun")).bold(),
        Line::from(or(motion(view), "the controller has not spoken yet")).style(alarm(stopped)),
        Line::from(or(arm(view), "the arm has not spoken yet")).style(alarm(braked)),
    ])
}

fn alarm(on: bool) -> Style {
    if on { Style::new().fg(Color::Red).add_modifier(Modifier::BOLD) } else { Style::new() }
}

fn figures(view: &View) -> Table<'_> {
    let widths = [11, 8, 5, 10, 9, 7, 8, 26, 15, 16, 6, 6, 8].map(Constraint::Length);
    let rows = view.loops.iter().map(|one| {
        let slow = one.rate_hz < 0.9 * one.rate_wanted_hz;
        Row::new(row(one)).style(alarm(slow))
    });
    Table::new(rows, widths).header(Row::new(COLUMNS).style(Style::new().add_modifier(Modifier::DIM)))
}

/// A bar for each octave, as high as its share of all in logarithm: a single late wake-up must be seen.
fn bar(one: &LoopView) -> String {
    let all = one.lateness_octaves.iter().sum::<u64>().max(1);
    let height = |count: u64| {
        if count == 0 { 0 } else { 1 + (7.0 * ((count as f64).ln_1p() / (all as f64).ln_1p())).round() as usize }
    };
    one.lateness_octaves.iter().map(|count| format!("{:<BAR_WIDTH$}", BARS[height(*count).min(8)])).collect()
}

fn lateness(view: &View) -> Paragraph<'_> {
    let line = |one: &LoopView| {
        let recent = &one.lateness_recent;
        Line::from(vec![
            Span::raw(format!("{:<11} ", one.role)),
            Span::styled(bar(one), Style::new().fg(Color::Cyan)),
            Span::raw(format!("  {:8.1} {:8.1} {:8.1} µs", recent.p50_us, recent.p99_us, recent.max_us)),
        ])
    };
    let axis = Line::from(format!("{:<11} {AXIS}", "")).style(Style::new().add_modifier(Modifier::DIM));
    Paragraph::new(view.loops.iter().map(line).chain([axis]).collect::<Vec<_>>())
}

fn input_ages(view: &View) -> Paragraph<'_> {
    let lines = view.loops.iter().filter(|one| !one.inputs.is_empty()).map(|one| {
        let ages = one.inputs.iter().map(|input| {
            let ms = |us: f64| us / 1e3;
            format!(
                "{} {:.1}/{:.1}/{:.1}",
                input.input,
                ms(input.age.p50_us),
                ms(input.age.p99_us),
                ms(input.age.max_us)
            )
        });
        Line::from(format!("{:<11} {}", one.role, ages.collect::<Vec<_>>().join("   ")))
    });
    Paragraph::new(lines.collect::<Vec<_>>()).wrap(Wrap { trim: false })
}

fn obtained(view: &View) -> Paragraph<'_> {
    let lines = view.loops.iter().flat_map(|one| {
        let granted = Line::from(format!("{:<11} {}", one.role, set_up(one)));
        let notice = (!one.notices.is_empty())
            .then(|| Line::from(format!("{:<11} {}", "", one.notices)).style(Style::new().fg(Color::Yellow)));
        [Some(granted), notice].into_iter().flatten()
    });
    Paragraph::new(lines.collect::<Vec<_>>()).wrap(Wrap { trim: false })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observe::{Age, ArmView, MotionView, PerCycle, Quantiles, StepView};
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;

    fn quantiles(p50_us: f64, p99_us: f64) -> Quantiles {
        Quantiles { p50_us, p99_us, p99_9_us: 2.0 * p99_us, max_us: 4.0 * p99_us }
    }

    fn controller() -> LoopView {
        let mut octaves = [0; 16];
        (octaves[5], octaves[10]) = (9_000, 1);
        LoopView {
            role: "controller",
            pid: 4_711,
            epoch: 2,
            restarts: 1,
            rate_wanted_hz: 1_000.0,
            rate_hz: 999.6,
            cycles: 123_456,
            missed: 7,
            overruns: 3,
            lateness_recent: quantiles(21.0, 88.0),
            lateness: quantiles(20.0, 80.0),
            lateness_octaves: octaves,
            busy: quantiles(30.0, 45.0),
            inputs: vec![Age { input: "arm/state".to_owned(), age: quantiles(200.0, 1_200.0) }],
            per_cycle: PerCycle {
                cycles: 9,
                allocations: Some(0.0),
                page_faults: Some(0.25),
                system_calls: None,
                preemptions: None,
            },
            fifo: Some(80),
            cpu: Some(1),
            memory_locked: true,
            prefaulted_kb: 256,
            dma_latency_us: Some(0),
            timer_slack_ns: 0,
            notices: String::new(),
        }
    }

    fn view() -> View {
        View {
            cell: "s471".to_owned(),
            instance: "s471-1-a".to_owned(),
            product: "s471".to_owned(),
            step: StepView {
                number: 2,
                part: Some("Top cover".to_owned()),
                subtask: "assemble",
                run: "run",
                prompt: None,
                feature: Some("threaded_hole"),
                confidence: 0.997,
            },
            motion: Some(MotionView {
                age_ms: 0.7,
                phase: "approach",
                stop: "running",
                cause: "none",
                stops: 4,
                clearance_m: 0.04,
                clearance_min_m: 0.034,
                separation_m: Some(1.5),
                separation_required_m: 0.6,
                speed: 0.5,
                tcp_speed_m_s: 0.25,
                elapsed_s: 1.0,
                expected_s: 6.0,
            }),
            arm: Some(ArmView {
                age_ms: 0.9,
                fault: "none",
                tool: "screwdriver",
                holding: true,
                position_rad: vec![0.0; 6],
                velocity_rad_s: vec![0.0, -0.5],
            }),
            loops: vec![controller()],
        }
    }

    fn screen(view: &View, width: u16, height: u16) -> String {
        let mut terminal = Terminal::new(TestBackend::new(width, height)).expect("a screen in memory");
        terminal.draw(|frame| draw(frame, view)).expect("drawn");
        terminal.backend().to_string()
    }

    #[test]
    fn the_screen_shows_step_motion_loops_lateness_ages_and_set_up() {
        let shown = screen(&view(), 170, 30);
        for text in [
            "tandem top: s471-1-a",
            "box 2, Top cover: assemble (run), seen: threaded_hole 99.7 %",
            "running, approach 1.0 of 6.0 s, 4 stops, clearance 40 mm (least 34), person at 1.50 m of 0.60 m owed",
            "brakes open, screwdriver holds a part, fastest joint 0.50 rad/s",
            "4711     2     1000/1000  123456    7       3        20/80/160/320",
            "45/180          1.2 ms           0.00   0.25   -",
            "21.0     88.0    352.0 µs",
            "arm/state 0.2/1.2/4.8",
            "FIFO 80, processor 1, locked, 256 kB touched, slack 0 ns, wakes within 0 µs",
        ] {
            assert!(shown.contains(text), "{text:?} is not on\n{shown}");
        }
    }

    /// One wake-up among thousands still has a bar, in its own octave; the full one is where nearly all are.
    #[test]
    fn a_single_late_wake_up_is_seen() {
        let drawn: Vec<char> = bar(&controller()).chars().step_by(BAR_WIDTH).collect();
        assert_eq!((drawn[5], drawn[10]), ('█', '▂'));
        assert!(drawn.iter().enumerate().all(|(at, bar)| *bar == ' ' || at == 5 || at == 10), "{drawn:?}");
    }

    /// Before anybody has spoken, and on a screen far too small, nothing fails.
    #[test]
    fn an_empty_cell_and_a_small_screen_are_drawn() {
        let empty =
            View { motion: None, arm: None, loops: Vec::new(), step: StepView { number: 0, ..view().step }, ..view() };
        let shown = screen(&empty, 100, 24);
        assert!(shown.contains("no box has begun") && shown.contains("the arm has not spoken yet"), "{shown}");
        screen(&view(), 12, 4);
    }

    #[test]
    fn a_stop_is_named() {
        let mut stopped = view();
        let motion = stopped.motion.as_mut().expect("there");
        (motion.stop, motion.cause) = ("stopped", "separation");
        assert!(screen(&stopped, 170, 30).contains("stopped (separation)"));
    }
}
