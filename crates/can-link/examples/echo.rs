//! Echo program for a CAN bus: `cargo run --example echo -- URL`. The program answers every received frame with a
//! frame that has the same payload. The identifier of the answer is higher by 1.

use std::time::Duration;

use can_link::{CanBus, CanFrame, Id, open};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let url = std::env::args().nth(1).unwrap_or_else(|| "multicast:239.74.163.2:43113".into());
    let mut bus = open(&url)?;
    println!("ready: {url}");
    loop {
        if let Some(frame) = bus.receive(Duration::from_secs(1))? {
            bus.send(&echo_of(&frame)?)?;
        }
    }
}

fn echo_of(frame: &CanFrame) -> Result<CanFrame, can_link::InvalidFrame> {
    let next = frame.id().value() + 1;
    let id = if frame.is_extended() { Id::extended(next) } else { Id::standard(next) }?;
    if frame.is_remote() {
        return CanFrame::remote(id, frame.len());
    }
    if frame.is_fd() {
        return Ok(CanFrame::fd(id, frame.data())?.with_brs(frame.is_brs()));
    }
    CanFrame::classic(id, frame.data())
}
