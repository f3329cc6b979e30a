//! `jtc monitor`: the controller live. A full view on a terminal, one line a status elsewhere.

use std::collections::VecDeque;
use std::io::IsTerminal;
use std::time::Duration;

use cli_kit::{Output, Stop};
use crossterm::event::{self, Event, KeyCode, KeyModifiers};
use jtc_host::port::SerialPort;
use jtc_host::{Session, words};
use jtc_wire::Status;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout};
use ratatui::style::{Color, Modifier, Style, Stylize};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, BorderType, Cell, Padding, Paragraph, Row, Sparkline, Table};

use super::status;
use crate::args::MonitorArgs;
use crate::failure::Failure;

/// Values that the curves show: 8 s of statuses.
const HISTORY: usize = 200;
/// Colours of the joints, as in the report.
const COLOURS: [Color; 6] = [
    Color::Rgb(122, 165, 255),
    Color::Rgb(255, 157, 87),
    Color::Rgb(67, 211, 158),
    Color::Rgb(255, 119, 182),
    Color::Rgb(183, 155, 255),
    Color::Rgb(227, 200, 76),
];

/// Shows statuses until `q`, Ctrl-C, or so many of them.
pub fn monitor(args: &MonitorArgs, out: &Output) -> Result<(), Failure> {
    let mut session = args.link.session()?;
    let full = !out.is_json() && std::io::stdout().is_terminal() && std::io::stdin().is_terminal();
    if full { live(&mut session, args.count) } else { lines(&mut session, args.count, out) }
}

fn lines(session: &mut Session<SerialPort>, count: Option<u64>, out: &Output) -> Result<(), Failure> {
    let stop = Stop::listen()?;
    let mut left = count.unwrap_or(u64::MAX);
    while left > 0 && !stop.asked() {
        let s = session.next_status()?;
        let time_s = session.now().as_secs_f64();
        let mut value = status::as_json(&s);
        value["received_s"] = time_s.into();
        out.result(&value, || {
            let q: Vec<String> = s.joints.iter().map(|j| format!("{:8.4}", j.position)).collect();
            let errors = if s.errors == 0 { String::new() } else { format!("   {}", words::errors_line(&s)) };
            format!(
                "{time_s:8.3} s   {:8} {:7} {:6}{errors}   {}",
                words::state(s.fsm),
                words::tes(s.tes),
                s.point,
                q.join(" ")
            )
        });
        left -= 1;
    }
    Ok(())
}

/// What the view remembers.
struct View {
    port: String,
    last: Option<Status>,
    silent: bool,
    rate: f64,
    retries: u64,
    position: [VecDeque<f64>; 6],
    torque: [VecDeque<f64>; 6],
}

fn live(session: &mut Session<SerialPort>, count: Option<u64>) -> Result<(), Failure> {
    use jtc_host::Port;
    let port = session.port().name();
    let mut view = View {
        port,
        last: None,
        silent: false,
        rate: 0.0,
        retries: 0,
        position: Default::default(),
        torque: Default::default(),
    };
    let mut left = count.unwrap_or(u64::MAX);
    let mut terminal = ratatui::try_init()?;
    let mut run = || -> Result<(), Failure> {
        let mut drawn = Duration::ZERO;
        let mut heard = session.now();
        while left > 0 {
            while event::poll(Duration::ZERO)? {
                if let Event::Key(key) = event::read()? {
                    let ctrl_c =
                        key.code == KeyCode::Char('c') && key.modifiers.contains(KeyModifiers::CONTROL);
                    if ctrl_c || matches!(key.code, KeyCode::Char('q') | KeyCode::Esc) {
                        return Ok(());
                    }
                }
            }
            if let Some(s) = session.poll(Duration::from_millis(100))? {
                heard = session.now();
                view.push(s);
                left -= 1;
            }
            view.silent = session.now().saturating_sub(heard) > Duration::from_secs(1);
            view.rate = session.statistics().status_rate();
            view.retries = session.statistics().bad_bytes;
            // 25 pictures a second are enough, however fast statuses come.
            if session.now() - drawn >= Duration::from_millis(40) || drawn == Duration::ZERO {
                drawn = session.now();
                terminal.draw(|frame| view.draw(frame))?;
            }
        }
        Ok(())
    };
    let done = run();
    ratatui::restore();
    done
}

impl View {
    fn push(&mut self, s: Status) {
        for (j, joint) in s.joints.iter().enumerate() {
            for (history, value) in
                [(&mut self.position[j], joint.position), (&mut self.torque[j], joint.torque)]
            {
                history.push_back(f64::from(value));
                if history.len() > HISTORY {
                    history.pop_front();
                }
            }
        }
        self.last = Some(s);
    }

    fn draw(&self, frame: &mut Frame<'_>) {
        let [head, joints, curves, foot] = Layout::vertical([
            Constraint::Length(4),
            Constraint::Length(9),
            Constraint::Min(6),
            Constraint::Length(3),
        ])
        .areas(frame.area());
        let Some(s) = &self.last else {
            let text = if self.silent {
                "no status comes; `jtc doctor` looks for the reason"
            } else {
                "waiting for a status"
            };
            frame.render_widget(Paragraph::new(text).block(panel(&format!(" {} ", self.port))), head);
            return;
        };
        frame.render_widget(self.head(s), head);
        frame.render_widget(joint_table(s), joints);
        let grid = Layout::horizontal([Constraint::Ratio(1, 6); 6]).split(curves);
        for j in 0..6 {
            let [top, bottom] = Layout::vertical([Constraint::Fill(1); 2]).areas(grid[j]);
            frame.render_widget(curve(&self.position[j], j, "q"), top);
            frame.render_widget(curve(&self.torque[j], j, "τ"), bottom);
        }
        frame.render_widget(self.foot(s), foot);
    }

    fn head(&self, s: &Status) -> Paragraph<'static> {
        let state = Span::styled(format!(" {} ", words::state(s.fsm)), state_style(s.fsm));
        let mut line = vec![state, Span::raw("  trajectory "), words::tes(s.tes).bold()];
        line.push(Span::raw(format!("   point {} ({:.2} s)", s.point, f64::from(s.point) * 1e-3)));
        if let Some(g) = s.gripper {
            line.push(Span::raw(format!("   pump {}", if g.pump != 0 { "runs" } else { "stands" })));
        }
        let link = if self.silent {
            "no status comes any more".red().bold()
        } else {
            format!("{:.1} statuses/s, {} bad bytes", self.rate, self.retries).dark_gray()
        };
        Paragraph::new(vec![Line::from(line), Line::from(link)]).block(panel(&format!(" {} ", self.port)))
    }

    fn foot(&self, s: &Status) -> Paragraph<'static> {
        let line = if s.errors != 0 {
            Line::from(vec![
                "errors ".red().bold(),
                words::errors_line(s).red(),
                format!("   {}", words::next_step(s)).into(),
            ])
        } else {
            Line::from(vec![words::next_step(s).replace('`', "").into(), "     q ends".dark_gray()])
        };
        Paragraph::new(line).block(panel(" next "))
    }
}

fn panel(title: &str) -> Block<'static> {
    Block::bordered()
        .border_type(BorderType::Rounded)
        .border_style(Style::new().dark_gray())
        .title(title.to_owned())
        .padding(Padding::horizontal(1))
}

fn state_style(fsm: u8) -> Style {
    let colour = match fsm {
        2 => Color::Rgb(47, 131, 124),
        3 => Color::Rgb(63, 111, 224),
        4 => Color::Rgb(125, 87, 201),
        5 => Color::Rgb(201, 70, 59),
        _ => Color::Rgb(86, 97, 115),
    };
    Style::new().bg(colour).fg(Color::White).add_modifier(Modifier::BOLD)
}

fn joint_table(s: &Status) -> Table<'static> {
    let rows = s.joints.iter().enumerate().map(|(j, joint)| {
        let mut trouble: Vec<&str> = words::joint_errors(joint.internal);
        trouble.extend(words::node_errors(joint.errors));
        trouble.extend(words::motor_faults(joint.mc_current));
        trouble.extend(words::node_warnings(joint.warnings));
        Row::new(vec![
            Cell::from(format!("● joint {}", j + 1)).style(Style::new().fg(COLOURS[j])),
            Cell::from(words::node_state(joint.fsm)),
            Cell::from(format!("{:>9.4}", joint.position)),
            Cell::from(format!("{:>9.4}", joint.velocity)),
            Cell::from(format!("{:>9.2}", joint.torque)),
            Cell::from(format!("{:>4}", joint.temperature)),
            Cell::from(trouble.join(", ")).style(Style::new().red()),
        ])
    });
    let widths = [9, 20, 10, 10, 10, 5].map(Constraint::Length);
    Table::new(rows, widths.into_iter().chain([Constraint::Min(8)]))
        .header(Row::new(["", "state", "  q, rad", " qd, rad/s", "  τ, N·m", "  °C", ""]).dark_gray())
        .block(panel(" joints "))
}

fn curve(history: &VecDeque<f64>, j: usize, name: &str) -> Sparkline<'static> {
    let low = history.iter().copied().fold(f64::INFINITY, f64::min);
    let high = history.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    // A resting value is not blown up to full height.
    let span = (high - low).max(0.01);
    let heights: Vec<u64> = history.iter().map(|v| (((v - low) / span) * 100.0) as u64 + 1).collect();
    let last = history.back().copied().unwrap_or(0.0);
    Sparkline::default()
        .data(heights)
        .max(101)
        .style(Style::new().fg(COLOURS[j]))
        .block(panel(&format!(" {name}{} {last:.2} ", j + 1)))
}
