//! Starts the procedure that performs a request.
use crate::master::engine::Link;
use crate::master::error::Error;
use crate::master::procedures::{
    conformance::procedure::conformance, probe::measure::probe, update::procedure::update,
};
use crate::master::procedures::{control, describe, init, one_board, raw_status, repair, run, scan, stop};
use crate::master::reports::{Outcome, Request};

/// A procedure in progress, as a future.
pub(crate) type Work = core::pin::Pin<Box<dyn Future<Output = Result<Outcome, Error>> + Send>>;

/// Returns the procedure that performs a request.
pub(crate) fn work(link: Link, request: Request) -> Work {
    let (outer, end, boards) = (link.clone(), link.clone(), request.claims());
    let looks = !request.bears_shared_numbers() && boards != u32::MAX;
    let inner: Work = match request {
        // These procedures undo their changes when the caller cancels them.
        Request::Update(options) => return Box::pin(update(link, options)),
        Request::Run(options) => return Box::pin(run::run(link, options)),
        Request::Conformance(options) => return Box::pin(conformance(link, options)),
        Request::Probe(options) => return Box::pin(probe(link, options)),
        Request::Scan => Box::pin(scan::scan(link)),
        Request::Init(options) => Box::pin(init::init(link, options)),
        Request::Repair { board, flash_number, force } => {
            Box::pin(repair::repair_procedure(link, board, flash_number, force))
        }
        Request::Info { board } => Box::pin(control::info_procedure(link, board)),
        Request::SetStatus { board, mask, value, force } => {
            Box::pin(control::set_status_procedure(link, board, mask, value, force))
        }
        Request::Reset { board, force } => Box::pin(control::reset(link, board, force)),
        Request::XReset { board, force } => Box::pin(control::xreset(link, board, force)),
        Request::Start { board, force } => Box::pin(control::start(link, board, force)),
        Request::Stop { board, level, force } => Box::pin(stop::stop(link, board, level, force)),
        Request::Admin { board, change, force } => {
            Box::pin(control::admin_procedure(link, board, change, force))
        }
        Request::Describe { board, fresh } => Box::pin(describe::describe_procedure(link, board, fresh)),
        Request::InitialInputs { board } => Box::pin(describe::initial_inputs_procedure(link, board)),
        Request::RawStatus { board, seen, mask, value, force } => {
            Box::pin(raw_status::raw_status(link, board, seen, (mask, value), force))
        }
    };
    let whole = async move {
        let outcome = inner.await?;
        if looks {
            one_board::last_answers(&end, boards).await;
        }
        Ok(outcome)
    };
    Box::pin(async move { outer.or_cancel(whole).await })
}
