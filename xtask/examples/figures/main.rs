//! Measures performance figures that need several crates. The program prints lines `name value`, which `cargo xtask
//! bench` adds to the figures of the crates.
//!
//! Run `figures` for all groups, or `figures libm|tick|line|tracking|ucom|recording` for one group. Figures in
//! virtual time are the same in every run. `figures recording-file FILE SECONDS` writes a recording of this duration,
//! with the same kind of data as the recording that the group `recording` measures.

mod libm;
mod line;
mod path;
mod recording;
mod tick;
mod tracking;
mod ucom_bus;
mod world;

fn main() -> world::Result<()> {
    let only = std::env::args().nth(1);
    match std::env::args().skip(1).collect::<Vec<_>>().as_slice() {
        [what, file] if what == "recording-memory" => return recording::memory(file.as_ref()),
        [what, file, seconds] if what == "recording-file" => {
            return recording::write(file.as_ref(), seconds.parse()?);
        }
        _ => {}
    }
    let wanted = |name: &str| only.as_deref().is_none_or(|only| only == name);
    if wanted("libm") {
        libm::figures();
    }
    if wanted("tick") {
        tick::figures()?;
    }
    if wanted("line") {
        line::figures()?;
    }
    if wanted("tracking") {
        tracking::figures()?;
    }
    if wanted("ucom") {
        ucom_bus::figures()?;
    }
    if wanted("recording") {
        recording::figures()?;
    }
    Ok(())
}

/// Prints the name and the value of a performance figure.
fn print(name: &str, value: f64) {
    println!("{name} {value:.6}");
}
