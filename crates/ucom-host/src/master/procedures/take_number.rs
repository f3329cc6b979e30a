//! Sends PC_INIT, which assigns a number to one board (D-21, D-24).
use crate::master::engine::{Link, MS};
use crate::master::error::{AddressError, Error};
use crate::master::procedures::exchange::TRIES;
use crate::master::procedures::exchange::{Answer, ask_info};
use ucom::{ErrorCode, FromBoard, Function, Status, ToBoard};

/// Sends PC_INIT at most three times, until the board acknowledges it or answers PC_INFO. If `lower` is set, the
/// function switches off the board's outgoing pin before each repetition. Otherwise, the next board would also take
/// the number if the board has switched on its pin by itself.
pub(crate) async fn take_number(link: &Link, number: u8, lower: bool) -> Result<bool, Error> {
    let to = link.board(number)?;
    let nobody = link.profile().unnumbered().number();
    for tried in 0..TRIES {
        if lower && tried > 0 {
            link.send(to, ToBoard::SetStatus { mask: Status::OPINIT.0, value: 0 }).await;
            link.sleep(20 * MS).await;
        }
        link.listen(u32::MAX, &[Function::InitAck, Function::DspInfo]);
        link.ask(to, ToBoard::Init).await;
        let mut until = link.now() + link.times().init_ack;
        let mut acknowledged = false;
        while let Some(received) = link.next(until).await {
            match received.message {
                FromBoard::InitAck(data) if received.from == number || data == number => {
                    if received.from != data {
                        return Err(AddressError::AckMismatch { id: received.from, data }.into());
                    }
                    acknowledged = true;
                    break;
                }
                // The board has not sent the acknowledgement of its previous PC_INIT yet (D-24), so the procedure waits for this
                // acknowledgement.
                FromBoard::Error(ErrorCode::Reinit) if received.from == nobody || received.from == number => {
                    until = until.max(link.now() + 100 * MS);
                }
                _ => {}
            }
        }
        if acknowledged {
            return Ok(true);
        }
        // The acknowledgement of the board may have been lost, so PC_INIT is not repeated without a PC_INFO. An incomplete answer to
        // PC_INFO is enough, because it shows that a board has this number. The caller reads the identity of the board later.
        link.listen(1 << number, &[Function::DspInfo]);
        if !matches!(ask_info(link, number).await?, Answer::Silence) {
            return Ok(true);
        }
    }
    Ok(false)
}
