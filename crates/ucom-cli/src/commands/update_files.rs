//! Firmware files and date of an update, which the command checks against the plan in the profile.

use std::path::{Path, PathBuf};

use cli_kit::{Failure, Output};
use time::{Date, Month, OffsetDateTime};
use ucom::Profile;
use ucom::profile::Plan;
use ucom_host::files::image::{AddressUnit, Format, Gaps, ImageAdvice};
use ucom_host::files::{Image, ImageError, ImageOptions};
use ucom_host::master::update::{UpdateImage, has_header};

use crate::args::{Addresses, UpdateArgs};

/// Contents of the firmware files.
pub(super) struct Files {
    /// Image in the first file of the command line.
    pub image: UpdateImage,
    /// Image in the second file; `None` if the user specifies only one file.
    pub second: Option<UpdateImage>,
    /// Paths of the image files, in the order of the images.
    pub names: Vec<PathBuf>,
    /// Text about each image file.
    pub notes: Vec<String>,
}

impl Files {
    /// Reads the image files that the plan needs, and refuses other files.
    pub(super) fn read(args: &UpdateArgs, profile: &Profile, out: &Output) -> Result<Self, Failure> {
        if args.name_target && !has_header(profile) {
            return Err(Failure::usage(
                "--name-target: the name is part of the header, but the profile sends no header",
            ));
        }
        let other = second(args, profile.prog_plan)?;
        let (image, first) = image(&args.image, args, out)?;
        let second = other.map(|file| self::image(file, args, out)).transpose()?;
        let (second, more) = second.unzip();
        let notes = [Some(first), more].into_iter().flatten().collect();
        let names = [Some(args.image.as_path()), other].into_iter().flatten().map(Path::to_owned).collect();
        Ok(Self { image, second, names, notes })
    }
}

fn image(file: &Path, args: &UpdateArgs, out: &Output) -> Result<(UpdateImage, String), Failure> {
    let address_unit = args.addresses.map(|unit| match unit {
        Addresses::Byte => AddressUnit::Byte,
        Addresses::Word => AddressUnit::Word,
    });
    let gaps = args.fill_gaps.map_or(Gaps::Refuse, Gaps::Fill);
    let format = args.raw.then_some(Format::Bin);
    let options = ImageOptions { format, address_unit, gaps, ..Default::default() };
    let image = Image::read(file, &options).map_err(|e| {
        // The file name is added, unless the text of the error already contains it.
        let (path, text) = (file.display().to_string(), e.to_string());
        let failure = Failure::usage(if text.contains(&path) { text } else { format!("{path}: {text}") });
        failure.next(advice(&e))
    })?;
    for note in image.notes() {
        out.note(format!("note: {}: {note}", file.display()));
    }
    let count =
        image.address_unit(&options).map_or_else(String::new, |unit| format!(", addresses in {unit}s"));
    let note = format!(
        "{}: {}, {} bytes from word 0x{:X}{count}",
        file.display(),
        image.format_name(),
        image.bytes().len(),
        image.address_words()
    );
    Ok((image.into(), note))
}

/// Returns the hint for an invalid image file. The hint never suggests skipping a check of the file's content.
fn advice(error: &ImageError) -> String {
    match error.advice() {
        ImageAdvice::None => String::new(),
        ImageAdvice::MakeAgain => {
            "make the file again with the tool chain; images are Intel HEX, S-record, or raw bytes in a \
             .bin file"
                .into()
        }
        ImageAdvice::NameRaw => {
            "if these are the raw bytes of a program, rename the file to .bin, or use --raw".into()
        }
        ImageAdvice::Rename => "if these are the raw bytes of a program, rename the file to .bin".into(),
        ImageAdvice::FillGaps => {
            "if nothing belongs there, use --fill-gaps 0xFF (the erased state of flash)".into()
        }
        ImageAdvice::OtherUnit(unit) => format!(
            "if the tool chain counts {unit}s, use --addresses {unit}. Otherwise use --addresses with the other unit. \
             If gaps remain and are intended, also use --fill-gaps 0xFF"
        ),
        ImageAdvice::Addresses => {
            "make the file again: its addresses are valid neither in bytes nor in words".into()
        }
    }
}

/// Returns the path of the second image file. Returns an error if the files do not match the plan.
fn second(args: &UpdateArgs, plan: Plan) -> Result<Option<&Path>, Failure> {
    let options = [
        ("--exloader", Plan::ExloaderApp, &args.exloader),
        ("--data", Plan::PmemXmem, &args.data),
        ("--second", Plan::Raw, &args.second),
    ];
    for (option, fits, given) in options {
        if given.is_some() && plan != fits {
            let text = format!("{option} needs `prog.plan` {fits}, but the profile has {plan}");
            let hint =
                "give the boards' profile with --profile FILE; ucom help profile lists its keys and plans";
            return Err(Failure::usage(text).next(hint));
        }
    }
    for (option, fits, given) in options {
        match given {
            Some(given) => return Ok(Some(given)),
            None if plan == fits && plan != Plan::Raw => {
                let text =
                    format!("`prog.plan` {plan} sends two images, but only one was given: add {option} FILE");
                return Err(Failure::usage(text).next(match plan {
                    Plan::ExloaderApp => {
                        "IMAGE is the application, and the other file is the exloader for RAM"
                    }
                    _ => "IMAGE is for program memory, and the other file is for data memory",
                }));
            }
            None => {}
        }
    }
    Ok(None)
}

/// Returns the flash date: the requested date, or else the current date (UTC). Returns 0 if the headers contain
/// no date.
pub(super) fn day(asked: Option<&str>, profile: &Profile) -> Result<u16, Failure> {
    let form = profile.prog_date;
    let date = match asked {
        Some(_) if !has_header(profile) => {
            return Err(Failure::usage(
                "--date: the date is part of the header, but the profile sends no header",
            )
            .next("see prog.plan and prog.header in ucom help profile"));
        }
        None if !has_header(profile) => return Ok(0),
        Some(text) => match text.strip_prefix("0x").or(text.strip_prefix("0X")) {
            Some(hex) => {
                return u16::from_str_radix(hex, 16)
                    .map_err(|_| Failure::usage(format!("--date {text}: the number has more than 16 bits")));
            }
            None => parsed(text).ok_or_else(|| {
                Failure::usage(format!(
                    "--date {text} is not a valid date, expected YYYY-MM-DD or a number such as 0x3AC1"
                ))
            })?,
        },
        None => OffsetDateTime::now_utc().date(),
    };
    let year = u16::try_from(date.year()).ok();
    year.and_then(|year| form.encode(year, date.month().into(), date.day())).ok_or_else(|| {
        Failure::usage(format!("prog.date = {form} cannot store the date {date}"))
            .next("give the date as a 16-bit number, such as --date 0x3AC1")
    })
}

fn parsed(text: &str) -> Option<Date> {
    let mut parts = text.split('-');
    let (year, month) = (parts.next()?.parse().ok()?, parts.next()?.parse::<u8>().ok()?);
    let day = parts.next()?.parse().ok()?;
    let date = Date::from_calendar_date(year, Month::try_from(month).ok()?, day).ok()?;
    parts.next().is_none().then_some(date)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ucom::DateForm;

    /// D-45: a flash date is a calendar day in the format of the profile, or a plain number.
    #[test]
    fn d45_dates_are_days_of_the_calendar() {
        let fat = Profile::default();
        let read = |text: &str| day(Some(text), &fat).ok();
        assert_eq!((read("2009-06-01"), read("0x3AC1")), (Some(0x3AC1), Some(0x3AC1)));
        assert_eq!(read("2024-02-29"), Some(44 << 9 | 2 << 5 | 29));
        let wrong = [
            "2009",
            "2009-06",
            "2009-06-01-1",
            "x-06-01",
            "1979-01-01",
            "2009-13-01",
            "2023-02-29",
            "0x10000",
        ];
        for wrong in wrong {
            assert!(read(wrong).is_none(), "{wrong}");
        }
        assert!(day(None, &fat).is_ok_and(|today| today > 0x3AC1));
        // The date format `Raw` has no calendar, so only plain numbers are valid.
        let raw = Profile { prog_date: DateForm::Raw, ..fat };
        assert_eq!(day(Some("0x1234"), &raw).ok(), Some(0x1234));
        assert!(day(None, &raw).is_err_and(|e| e.next.to_string().contains("0x3AC1")));
        // If a profile has no header, its programs have no date.
        let none = Profile { prog_plan: Plan::Raw, ..fat };
        assert_eq!(day(None, &none).ok(), Some(0));
        assert!(day(Some("2009-06-01"), &none).is_err());
    }
}
