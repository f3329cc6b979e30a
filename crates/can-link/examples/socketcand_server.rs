//! A socketcand server with three buses, for any client program: `cargo run --example socketcand_server --
//! 127.0.0.1:29536`.
//!
//! - `can0`: the server answers every frame with a frame that has the same payload and an identifier that is higher
//!   by 1;
//! - `can1`: has no members except the clients, which exchange frames with each other;
//! - `busy`: the server continuously sends numbered frames with the identifier 7F0.

use std::time::Duration;

use can_link::{CanBus, CanError, CanFrame, Id, SocketcandServer, VirtualHub};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let address = std::env::args().nth(1).unwrap_or_else(|| "127.0.0.1:0".into());
    let [echo, quiet, busy] = [(); 3].map(|()| VirtualHub::new());
    let server =
        SocketcandServer::bind(address.as_str(), &[("can0", &echo), ("can1", &quiet), ("busy", &busy)])?;
    let mut talker = busy.join();
    std::thread::spawn(move || talk(&mut talker));
    let mut node = echo.join();
    println!("ready: {}", server.url("can0"));
    loop {
        if let Some(frame) = node.receive(Duration::from_secs(1))? {
            let next = frame.id().value() + 1;
            let id = if frame.is_extended() { Id::extended(next) } else { Id::standard(next) }?;
            node.send(&CanFrame::classic(id, frame.data())?)?;
        }
    }
}

fn talk(bus: &mut impl CanBus) -> Result<(), CanError> {
    let id = Id::standard(0x7F0).expect("11 bits");
    for number in 0_u32.. {
        let frame = CanFrame::classic(id, &number.to_be_bytes()).expect("4 bytes");
        bus.send(&frame)?;
        std::thread::sleep(Duration::from_micros(200));
    }
    Ok(())
}
