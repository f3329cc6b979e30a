//! `jtc firmware`: commands for images, USB drives of boards, flashing, and the running firmware.

use std::path::PathBuf;
use std::time::Duration;

use cli_kit::{Failure, Output};
use jtc_client::agents::owner_of;
use jtc_host::Port;
use jtc_host::firmware::{
    Catalogue, Drive, DriveAfter, FirmwareError, Fit, Image, Limits, Lines, Permissions, Places,
    Verification, compare, info_with_program, may_flash, verify_program, wait_for_drive, write_image,
};
use jtc_host::port::{PortError, PortInfo, SerialPort, list as ports, only_one};
use jtc_wire::Program;
use serde_json::{Value, json};

use crate::args::{FirmwareCommand, FlashArgs, ImageArgs, LinkArgs};
use crate::ask::confirm;

/// Runs a `jtc firmware` command.
pub(super) fn firmware(command: &FirmwareCommand, out: &Output) -> Result<(), Failure> {
    match command {
        FirmwareCommand::List => list(out),
        FirmwareCommand::Flash(args) => flash(args, out),
        FirmwareCommand::Verify { image, link } => verify(image, link, out),
    }
}

fn list(out: &Output) -> Result<(), Failure> {
    let drives = Places::of_system().drives();
    let catalogue = match Catalogue::find(&Catalogue::folders()) {
        Ok(catalogue) => Some(catalogue),
        Err(e @ FirmwareError::NoCatalogue { .. }) => {
            out.note(format!("{e}"));
            None
        }
        Err(e) => return Err(e.into()),
    };
    let value = json!({
        "folder": catalogue.as_ref().map(|c| &c.folder),
        "version": catalogue.as_ref().map(|c| &c.version),
        "images": catalogue.as_ref().map_or(&[][..], |c| &c.images),
        "drives": drives.iter().map(drive_json).collect::<Vec<_>>(),
    });
    out.result(&value, || {
        let mut text = String::new();
        if let Some(catalogue) = &catalogue {
            text += &format!("images of {} in {}:\n", catalogue.version, catalogue.folder.display());
            for image in &catalogue.images {
                text += &format!("  {}  {}, {} bytes\n", image.board, image.file, image.bytes);
            }
        }
        if drives.is_empty() {
            text += "no ST-LINK drive is mounted\nnext: connect the board's CN1; then udisksctl mount -b \
                    /dev/sdX, or --drive DIR";
        }
        for drive in &drives {
            let board = drive.board().map_or("unknown board", |(name, _)| name);
            text += &format!("drive {}: {board}\n", drive.path.display());
            if let Some(failure) = drive.failure() {
                text += &format!("  FAIL.TXT: {failure}\n");
            }
        }
        text
    });
    Ok(())
}

fn drive_json(drive: &Drive) -> Value {
    json!({
        "path": drive.path.display().to_string(),
        "label": drive.label,
        "board": drive.board().map(|(name, _)| name),
        "details": drive.details.trim(),
        "failure": drive.failure(),
    })
}

/// Returns the image that the user has specified. If the user has not specified an image, returns the installed image
/// for `board`.
fn image(
    args: &ImageArgs,
    board: impl FnOnce(&Catalogue) -> Result<String, Failure>,
) -> Result<Image, Failure> {
    if let Some(path) = &args.image {
        return Ok(Image::read(path)?);
    }
    let catalogue = Catalogue::find(&Catalogue::folders())?;
    let board = match &args.board {
        Some(board) => board.clone(),
        None => board(&catalogue)?,
    };
    Ok(catalogue.image(&board)?)
}

/// Returns the installed image of the board to which a drive belongs.
fn board_of(drive: &Drive, catalogue: &Catalogue) -> Result<String, Failure> {
    let fits = |board: &&String| drive.fit(board) == Fit::Same && !board.ends_with("-ldo");
    catalogue.images.iter().map(|image| &image.board).find(fits).cloned().ok_or_else(|| {
        let what = format!(
            "{}: no image selected, and no installed image fits the board of this drive",
            drive.path.display()
        );
        Failure::usage(what).next(
            "select one with `--board NAME` or `--image FILE`; `jtc firmware list` shows the boards and \
             images",
        )
    })
}

fn the_drive(places: &Places, named: Option<&PathBuf>) -> Result<Drive, Failure> {
    if let Some(path) = named {
        return Ok(places.at(path)?);
    }
    let mut drives = places.drives();
    match drives.len() {
        1 => Ok(drives.remove(0)),
        0 => Err(FirmwareError::NoneFound.into()),
        _ => {
            Err(FirmwareError::Several { drives: drives.into_iter().map(|drive| drive.path).collect() }
                .into())
        }
    }
}

/// Returns a port that the command checks in addition to the ports of the drive's USB device: the port that the user
/// has specified. If the user has specified no port, returns the only port of the computer. This is necessary only if
/// the board must report its firmware (`needed`) and its own port is not known (`has_own`).
fn named_port(link: &LinkArgs, has_own: bool, needed: bool) -> Result<Option<String>, Failure> {
    match &link.port {
        Some(url) if url.contains("://") => {
            let what = format!(
                "{url} is the address of an agent, but this command needs the serial port of the board; \
                 nothing was sent"
            );
            Err(Failure::usage(what)
                .next("end the agent that owns the port, then give the serial port, or leave out --port"))
        }
        Some(port) => Ok(Some(port.clone())),
        None if has_own || !needed => Ok(None),
        None => only_port().map(Some).map_err(|failure| {
            let hint = format!("{}; --no-read-back needs no port", failure.next);
            Failure::nothing_sent(failure).next(hint)
        }),
    }
}

/// Returns the only port of the computer. Ports that other programs have opened count, because the board may be connected to such a port.
fn only_port() -> Result<String, Failure> {
    let there = |port: &PortInfo| matches!(port.problem, None | Some(PortError::Busy { .. }));
    let mut paths: Vec<String> = ports()?.into_iter().filter(there).map(|port| port.path).collect();
    match paths.len() {
        0 => Ok(only_one()?),
        1 => Ok(paths.remove(0)),
        _ => Err(PortError::Several { paths }.into()),
    }
}

/// Opens a port for the exclusive use of this program.
fn open(port: &str, baud: u32) -> Result<Box<dyn Port>, PortError> {
    if owner_of(port).is_some() {
        return Err(PortError::Busy { path: port.to_owned() });
    }
    Ok(Box::new(SerialPort::open(port, baud)?))
}

fn flash(args: &FlashArgs, out: &Output) -> Result<(), Failure> {
    let places = Places::of_system();
    let drive = the_drive(&places, args.drive.as_ref())?;
    let image = image(&args.image, |catalogue| board_of(&drive, catalogue))?;
    let named = named_port(&args.link, !places.ports_of(&drive).is_empty(), !args.no_read_back)?;
    let mut opener = |port: &str| open(port, args.link.baud);
    let mut lines = Lines::open(&places, &drive, named.as_deref(), &mut opener)?;
    let record = image.record();
    out.note(format!(
        "{} {} for {}, build {}: {} bytes onto {}",
        image.path().display(),
        record.version,
        record.board,
        record.build,
        image.bytes().len(),
        drive.path.display()
    ));
    if !image.is_whole() {
        out.note(
            "no firmware.json in the folder lists this file, so an incomplete file cannot be detected before \
             it is written",
        );
    }

    let before = lines.look()?;
    let permissions = Permissions { assume_board: args.assume_board, accept_supply: args.accept_supply };
    may_flash(&image, &drive, &before, permissions)?;
    let line = lines.proving().map(|(port, same_device)| (port.to_owned(), same_device));
    // The command considers only the ports of this board, because another board may already run the image.
    if let Some(program) =
        before.own_info().find_map(|info| compare(&image, info).ok()).filter(|_| !args.again)
    {
        out.result(&result(&image, &drive, line.as_ref(), false, Some(program)), || {
            format!(
                "the board already runs this image ({program}); nothing was written\nnext: --again flashes \
                 it anyway"
            )
        });
        return Ok(());
    }
    let question = before.to_confirm(&image).filter(|_| !args.yes);
    if let Some(question) = &question {
        confirm(question, "--yes")?;
    }
    // The command reads the state of the board again, because the user may have confirmed after several minutes.
    let now = lines.look()?;
    may_flash(&image, &drive, &now, permissions)?;
    if let Some(other) = now.to_confirm(&image).filter(|now| !args.yes && question.as_ref() != Some(now)) {
        return Err(FirmwareError::Changed {
            what: format!("the report of the board has changed in the meantime: {other}"),
        }
        .into());
    }
    places.still_there(&drive)?;

    let bar = out.bytes_bar(image.bytes().len() as u64, "copying");
    let mut lines = Some(lines);
    let written = write_image(&drive, &image, &mut |bytes| {
        // The ports are closed as soon as copying begins. The ST-LINK may remove its serial port from USB together
        // with its drive. A port that is still open would then appear again under another name.
        drop(lines.take());
        bar.set_position(bytes as u64);
    });
    bar.finish_and_clear();
    let written = written?;
    let limits = Limits { wait: Duration::from_secs(args.wait), ..Limits::default() };
    let Some((port, same_device)) = line.filter(|_| !args.no_read_back) else {
        let seen = wait_for_drive(&places, &drive, &written, limits)?;
        let mut value = result(&image, &drive, None, true, None);
        value["drive_after"] = json!(seen);
        value["doubt"] = json!(written.doubt);
        out.result(&value, || not_proved(seen, written.doubt.as_deref()));
        return Ok(());
    };
    out.note("copied; the ST-LINK writes the image to the flash, then the board starts");
    // After flashing, the port of the board may have another name, so the command searches for the port again.
    let mut again = || {
        let own = places.ports_of(&drive).into_iter().next();
        open(own.as_ref().unwrap_or(&port), record.baud)
    };
    let verification = verify_program(&places, &image, &drive, &written, &mut again, limits)?;
    let line = (port.clone(), same_device);
    let mut value = result(&image, &drive, Some(&line), true, Some(verification.program));
    value["drive_after"] = json!(verification.drive);
    value["doubt"] = json!(written.doubt);
    value["took_s"] = json!(verification.took.as_secs_f64());
    value["stored_arm"] = json!(stored_arm(now.stored_arm(), verification.stored_arm()));
    out.result(&value, || proved(&verification, &line, now.stored_arm()));
    Ok(())
}

/// Name of a serial port, and `true` if the port belongs to the USB device of the drive.
type Line = (String, Option<bool>);

fn result(
    image: &Image,
    drive: &Drive,
    line: Option<&Line>,
    written: bool,
    program: Option<Program>,
) -> Value {
    json!({
        "image": image.path().display().to_string(),
        "board": image.record().board,
        "version": image.record().version,
        "build": image.record().build,
        "bytes": image.bytes().len(),
        "drive": drive.path.display().to_string(),
        "port": line.map(|(port, _)| port),
        "same_device": line.and_then(|(_, same_device)| *same_device),
        "written": written,
        "proved": program.is_some(),
        "program": program.map(program_json),
    })
}

fn program_json(program: Program) -> Value {
    json!({ "bytes": program.bytes, "crc32": format!("{:08x}", program.crc32) })
}

/// Describes how flashing affects the arm that is stored in the board.
fn stored_arm(before: Option<bool>, after: bool) -> &'static str {
    match (before, after) {
        (Some(true), false) => "lost",
        (_, true) => "kept",
        (Some(false), false) => "none",
        (None, false) => "unknown",
    }
}

fn proved(verification: &Verification, (port, same_device): &Line, stored_before: Option<bool>) -> String {
    let device = match same_device {
        Some(true) => "belongs to the same USB device as the drive",
        Some(false) => "belongs to another USB device than the drive: check that it is the flashed board",
        None => "may belong to another board than the drive: the system does not report this",
    };
    let arm = match stored_arm(stored_before, verification.stored_arm()) {
        "lost" => "\nthe stored arm is lost; next: jtc arm push FILE --store",
        "kept" => "\nthe stored arm is unchanged",
        _ => "",
    };
    format!(
        "the board runs {} on {}; its flash contains the image: {} ({:.0} s)\n\
         the port {port} of this check {device}{arm}\n\
         next: if this firmware is new on the board, cycle the power once, then jtc doctor",
        verification.info.firmware_and_revision(),
        verification.info.board,
        verification.program,
        verification.took.as_secs_f64(),
    )
}

fn not_proved(seen: DriveAfter, doubt: Option<&str>) -> String {
    let doubt = doubt
        .map_or(String::new(), |doubt| format!(" (at the end of the copy the system reported: {doubt})"));
    format!(
        "copied, but not verified: {seen}{doubt}\nnext: jtc firmware verify, over the board's serial port"
    )
}

fn verify(args: &ImageArgs, link: &LinkArgs, out: &Output) -> Result<(), Failure> {
    let mut session = link.session()?;
    session.next_status()?;
    let Some(info) = info_with_program(&mut session)? else {
        return Err(FirmwareError::NotReported { runs: "a controller without extensions".into() }.into());
    };
    let image = image(args, |_| Ok(info.board.as_str().to_owned()))?;
    let program = compare(&image, &info)?;
    let value = json!({
        "image": image.path().display().to_string(),
        "board": image.record().board,
        "version": image.record().version,
        "build": image.record().build,
        "proved": true,
        "program": program_json(program),
    });
    out.result(&value, || {
        format!(
            "the controller runs {} ({program}), {} on {}",
            image.path().display(),
            info.firmware_and_revision(),
            info.board
        )
    });
    Ok(())
}
