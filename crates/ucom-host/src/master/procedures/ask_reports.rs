//! Sends PC_REPORT and collects the reports of the boards.
use crate::master::engine::Link;
use crate::master::reports::Reports;
use ucom::{FromBoard, Function, ToBoard};

/// The four functions that boards use for reports.
pub(crate) const REPORTS: [Function; 4] =
    [Function::Report0, Function::Report1, Function::Report2, Function::Report3];

/// Sends PC_REPORT and collects the reports that arrive within the allowed time.
pub(crate) async fn ask_reports(link: &Link, reports: &mut Reports) {
    link.listen(0, &REPORTS);
    link.ask(link.broadcast_number(), ToBoard::Report).await;
    collect_reports(link, link.times().report_ask, reports).await;
}

/// Collects the reports that arrive within `window` µs.
pub(crate) async fn collect_reports(link: &Link, window: u64, reports: &mut Reports) {
    let until = link.now() + window;
    while let Some(received) = link.next(until).await {
        if let FromBoard::Report(report) = received.message {
            reports.add(&report);
        }
        if link.now() > until {
            break;
        }
    }
}
