//! Requests about boards, which every client may send.
use agent_kit::api::{Number, Problem, Refusals};
use axum::Json;
use axum::extract::State;

use super::objects::{BoardObject, ValuesObject};
use super::{Agent, Denials};

/// Returns the error response for an unknown board.
pub(super) fn unknown(number: u8) -> Problem {
    Problem::nothing("board", number, "/api/boards")
}

/// Checks that board numbers are valid.
///
/// # Errors
///
/// A board number is out of range (0–31).
pub(super) fn numbers(boards: impl IntoIterator<Item = u8>) -> Result<(), Problem> {
    match boards.into_iter().find(|board| *board > 31) {
        Some(board) => {
            let message = format!("board number {board} is out of range (0 to 31)");
            Err(Problem::new("board", message, "GET /api/boards lists the boards")
                .kind(host_kit::ErrorKind::Usage))
        }
        None => Ok(()),
    }
}

/// Returns the last known state of all boards.
///
/// The agent asks the boards at its start, during a scan, and whenever a request involves them.
#[utoipa::path(
    get,
    path = "/api/boards",
    operation_id = "list_boards",
    responses((status = 200, description = "Boards, ordered by number", body = Vec<BoardObject>), Refusals)
)]
pub(super) async fn boards(State(agent): State<Agent>) -> Json<Vec<BoardObject>> {
    Json(BoardObject::all(&agent.shared.snapshot()))
}

/// Returns the last known state of one board.
#[utoipa::path(
    get,
    path = "/api/boards/{number}",
    operation_id = "get_board",
    params(("number" = u8, Path, description = "Number of the board")),
    responses(
        (status = 200, description = "Board as last seen", body = BoardObject),
        (status = 404, description = "The agent knows no board with this number", body = Problem),
        Refusals
    )
)]
pub(super) async fn board(
    State(agent): State<Agent>,
    Number(number): Number<u8>,
) -> Result<Json<BoardObject>, Problem> {
    let snapshot = agent.shared.snapshot();
    let board = snapshot.boards.get(number).ok_or_else(|| unknown(number))?;
    Ok(Json(BoardObject::of(&snapshot, number, board)))
}

/// Returns the values of a board by name, with units if the signal table has them.
///
/// If the agent does not know the names of the values, it asks the board for them.
#[utoipa::path(
    get,
    path = "/api/boards/{number}/values",
    operation_id = "get_values",
    params(("number" = u8, Path, description = "Number of the board")),
    responses(
        (status = 200, description = "Values of the board", body = ValuesObject),
        (status = 404, description = "The agent knows no board with this number", body = Problem),
        Refusals, Denials
    )
)]
pub(super) async fn values(
    State(agent): State<Agent>,
    Number(number): Number<u8>,
) -> Result<Json<ValuesObject>, Problem> {
    let snapshot = agent.shared.snapshot();
    if snapshot.boards.get(number).is_none() {
        return Err(unknown(number));
    }
    if let Some(values) = snapshot.values.get(&number) {
        return Ok(Json(ValuesObject::of(&snapshot, values)));
    }
    if snapshot.competing_us.is_some() {
        // If the agent sent queries now, they could mix with the queries of the other PC on the
        // bus.
        let message = format!(
            "the names of board {number} are not known, and the agent cannot request them while another PC \
             is master of this bus"
        );
        return Err(Problem::new(
            "competing-master",
            message,
            "end the other program, or read the values there",
        ));
    }
    let asked = agent.shared.call(None, move |worker| {
        let known = worker.known_to_viewers(number)?;
        Ok(worker.values_of(&known))
    });
    let values = asked.await?;
    Ok(Json(ValuesObject::of(&agent.shared.snapshot(), &values)))
}
