//! A simulated SLCAN adapter on a pseudo-terminal, for any host program: `cargo run --example slcan_adapter`. The
//! adapter answers every frame on its bus with a frame that has the same payload. The identifier of the answer is
//! higher by 1.

#[cfg(unix)]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    use std::time::Duration;

    use can_link::{CanBus, CanFrame, Id, SlcanAdapter, VirtualHub};
    use serialport::{SerialPort, TTYPort};

    let (mut port, line) = TTYPort::pair()?;
    port.set_timeout(Duration::from_millis(1))?;
    let hub = VirtualHub::new();
    let (mut bus, mut node) = (hub.join(), hub.join());
    std::thread::spawn(move || {
        while let Ok(frame) = node.receive(Duration::MAX) {
            let Some(frame) = frame else { continue };
            let next = frame.id().value() + 1;
            let answer = || {
                let id = if frame.is_extended() { Id::extended(next) } else { Id::standard(next) }?;
                match (frame.is_remote(), frame.is_fd()) {
                    (true, _) => CanFrame::remote(id, frame.len()),
                    (_, true) => Ok(CanFrame::fd(id, frame.data())?.with_brs(frame.is_brs())),
                    _ => CanFrame::classic(id, frame.data()),
                }
            };
            if answer().is_ok_and(|answer| node.send(&answer).is_err()) {
                return;
            }
        }
    });
    // `line` stays open so that the terminal continues to exist after a host disconnects.
    println!("ready: {}", line.name().unwrap_or_default());
    let mut adapter = SlcanAdapter::new();
    loop {
        adapter.turn(&mut port, &mut bus)?;
    }
}

/// Only Unix has pseudo-terminals.
#[cfg(not(unix))]
fn main() {
    eprintln!("slcan_adapter needs pseudo-terminals, which this system does not have");
    std::process::exit(2);
}
