//! `jtc report`: creates the report page and picture of an existing recording.

use std::path::{Path, PathBuf};

use cli_kit::{Failure, Output};
use jtc_host::arm::Arm;
use jtc_host::recording::scan;
use jtc_host::report::{Digest, ReportInput, html, picture_svg};
use serde_json::json;

use super::job::stem;
use super::run_report;
use crate::args::ReportArgs;
use cli_kit::OutputFile;

/// Writes the report page and prints the results of each joint.
pub(super) fn report(args: &ReportArgs, out: &Output) -> Result<(), Failure> {
    let page = args.out.clone().unwrap_or_else(|| args.file.with_extension("html"));
    let picture = page.with_extension("svg");
    let inputs: Vec<&Path> =
        [Some(&args.file), args.arm.as_ref()].into_iter().flatten().map(PathBuf::as_path).collect();
    let overwrite = args.overwrite.overwrite;
    let page_file = OutputFile::open(&page, overwrite, &inputs)?;
    let picture_file = OutputFile::open(&picture, overwrite, &[&inputs[..], &[page.as_path()]].concat())?;
    let mut digest = Digest::new();
    let recording = scan(&args.file, |sample| digest.push(sample))?;
    if let Some(cut) = &recording.cut {
        out.note(format!("note: {}: {cut}", args.file.display()));
    }
    if recording.ending.lost_samples > 0 {
        let (file, lost) = (args.file.display(), recording.ending.lost_samples);
        out.note(format!("note: {file}: {lost} samples are missing, because the disk was too slow"));
    }
    let name = stem(&args.file);
    let arm = args.arm.as_deref().map(Arm::load).transpose()?;
    let info = match (arm, recording.info) {
        (Some(arm), _) => run_report::info(&arm, &args.file.display().to_string(), &name, 0),
        (None, Some(info)) => info,
        // A CSV recording does not contain the limits of the arm, so the report uses the limits of the built-in arm.
        (None, None) => run_report::info(&Arm::avena(), &args.file.display().to_string(), &name, 0),
    };
    let failure = digest.failure(&info, &recording.ending);
    let input = ReportInput { failure: failure.as_ref(), ..ReportInput::new(&info, &digest) };
    page_file.write(html(&input))?;
    picture_file.write(picture_svg(&input))?;
    let summary = digest.summary(&info);
    let value = json!({
        "recorded_s": summary.recorded_s,
        "executed_s": summary.executed_s,
        "samples": digest.samples(),
        "cut": recording.cut,
        "lost_samples": recording.ending.lost_samples,
        "joints": summary.joints,
        "failure": failure,
        "files": [page.display().to_string(), picture.display().to_string()],
    });
    out.result(&value, || {
        let made = format!("{}   open it in a browser\n{}", page.display(), picture.display());
        format!("{}\n{made}", run_report::verdict(failure.as_ref(), &summary))
    });
    Ok(())
}
