//! `jtc firmware`: images, the drives of boards, flashing one, and what runs there.

use std::path::PathBuf;
use std::time::Duration;

use cli_kit::{Failure, Output};
use jtc_host::firmware::{
    Answers, Before, Catalogue, Drive, DriveAfter, FirmwareError, Fit, Image, Limits, Permissions, Places,
    Proof, compare, info_with_program, look, may_flash, prove, put, same_usb_device, wait_for_drive,
};
use jtc_host::port::{PortError, SerialPort};
use jtc_host::{Port, Session};
use jtc_wire::Program;
use serde_json::{Value, json};

use crate::args::{FirmwareCommand, FlashArgs, ImageArgs, LinkArgs};
use crate::ask::confirm;

/// `jtc firmware …`
pub fn firmware(command: &FirmwareCommand, out: &Output) -> Result<(), Failure> {
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
            text += "no drive of an ST-LINK is mounted\nnext: connect the board's CN1; then udisksctl mount -b /dev/sdX, or --drive DIR";
        }
        for drive in &drives {
            let board = drive.board().map_or("a board that it does not name", |(name, _)| name);
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
        "path": drive.path,
        "label": drive.label,
        "board": drive.board().map(|(name, _)| name),
        "details": drive.details.trim(),
        "failure": drive.failure(),
    })
}

/// The image that was named; of the installed ones that of `board` where none was.
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

/// The installed image of the board to which a drive belongs.
fn board_of(drive: &Drive, catalogue: &Catalogue) -> Result<String, Failure> {
    let fits = |board: &&String| drive.fit(board) == Fit::Same && !board.ends_with("-ldo");
    catalogue.images.iter().map(|image| &image.board).find(fits).cloned().ok_or_else(|| {
        let what = format!("{}: which image? No installed one is named by this drive", drive.path.display());
        Failure::usage(what).hint("`--board NAME` or `--image FILE`; `jtc firmware list` shows both")
    })
}

fn the_drive(named: Option<&PathBuf>) -> Result<Drive, Failure> {
    let places = Places::of_system();
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

/// The serial port, when there is one to ask; it is not shared, for the board behind it is reset.
fn line(link: &LinkArgs, needed: bool) -> Result<Option<String>, Failure> {
    if link.port.is_none() && !needed {
        return Ok(None);
    }
    drop(link.own().map_err(|failure| {
        let hint = format!(
            "{}. The board is asked over its serial port itself, not by an agent; --no-read-back goes without",
            failure.hint
        );
        Failure::nothing_sent(failure).hint(hint)
    })?);
    Ok(Some(link.name()?))
}

fn open(name: &str, baud: u32) -> Result<Box<dyn Port>, PortError> {
    Ok(Box::new(SerialPort::open(name, baud)?))
}

fn flash(args: &FlashArgs, out: &Output) -> Result<(), Failure> {
    let drive = the_drive(args.drive.as_ref())?;
    let image = image(&args.image, |catalogue| board_of(&drive, catalogue))?;
    let port = line(&args.link, !args.no_read_back)?;
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

    let answers = match &port {
        Some(name) => look(&mut Session::new(open(name, args.link.baud)?))?,
        None => Answers::NoPort,
    };
    let same_device = port.as_ref().and_then(|name| same_usb_device(name, &drive));
    let before = Before { answers, same_device };
    let permissions = Permissions { assume_board: args.assume_board, accept_supply: args.accept_supply };
    may_flash(&image, &drive, &before, permissions)?;
    if let Some(Ok(program)) = before.info().map(|info| compare(&image, info)).filter(|_| !args.again) {
        out.result(&result(&image, &drive, false, Some(program)), || {
            format!("the board runs this image already ({program}); nothing was written\nnext: --again flashes it all the same")
        });
        return Ok(());
    }
    if let Some(question) = before.to_confirm().filter(|_| !args.yes) {
        confirm(question, "--yes")?;
    }

    let bar = out.bytes_bar(image.bytes().len() as u64, "copying");
    let written = put(&drive, &image, &mut |bytes| bar.set_position(bytes as u64));
    bar.finish_and_clear();
    let written = written?;
    let limits = Limits { wait: Duration::from_secs(args.wait), ..Limits::default() };
    let Some(name) = port.filter(|_| !args.no_read_back) else {
        let seen = wait_for_drive(&drive, &written, limits)?;
        let mut value = result(&image, &drive, true, None);
        value["drive_after"] = json!(seen);
        out.result(&value, || not_proved(seen));
        return Ok(());
    };
    out.note("copied; the ST-LINK writes it into the flash, and the board starts");
    let mut opener = || open(&name, args.link.baud);
    let proof = prove(&image, &drive, &written, &mut opener, limits)?;
    let mut value = result(&image, &drive, true, Some(proof.program));
    value["drive_after"] = json!(proof.drive);
    value["took_s"] = json!(proof.took.as_secs_f64());
    value["stored_arm"] = json!(stored_arm(before.stored_arm(), proof.stored_arm()));
    out.result(&value, || proved(&proof, before.stored_arm()));
    Ok(())
}

fn result(image: &Image, drive: &Drive, written: bool, program: Option<Program>) -> Value {
    json!({
        "image": image.path(),
        "board": image.record().board,
        "version": image.record().version,
        "build": image.record().build,
        "bytes": image.bytes().len(),
        "drive": drive.path,
        "written": written,
        "proved": program.is_some(),
        "program": program.map(program_json),
    })
}

fn program_json(program: Program) -> Value {
    json!({ "bytes": program.bytes, "crc32": format!("{:08x}", program.crc32) })
}

/// What became of the arm in the board's memory.
fn stored_arm(before: Option<bool>, after: bool) -> &'static str {
    match (before, after) {
        (Some(true), false) => "lost",
        (_, true) => "kept",
        (Some(false), false) => "none",
        (None, false) => "unknown",
    }
}

fn proved(proof: &Proof, stored_before: Option<bool>) -> String {
    let arm = match stored_arm(stored_before, proof.stored_arm()) {
        "lost" => "\nthe stored arm is lost; next: jtc arm push FILE --store",
        "kept" => "\nthe stored arm is still there",
        _ => "",
    };
    format!(
        "the board runs {} on {}; what it reads in its flash is the image: {} ({:.0} s){arm}\n\
         next: cycle the power once where this firmware is new on the board, then jtc doctor",
        proof.info.firmware_and_revision(),
        proof.info.board,
        proof.program,
        proof.took.as_secs_f64(),
    )
}

fn not_proved(seen: DriveAfter) -> String {
    let drive = match seen {
        DriveAfter::CameBack => "the drive vanished and came back without a report",
        DriveAfter::Gone => "the drive vanished, and has not come back",
        DriveAfter::Stayed => "the drive has not vanished: it is not certain that it took the image",
    };
    format!("copied, and not proved: {drive}\nnext: jtc firmware verify, over the board's serial port")
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
        "image": image.path(),
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
