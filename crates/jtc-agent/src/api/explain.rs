//! Meanings of codes: the pages of `jtc explain`.
use agent_kit::api::{Number, Problem, Refusals};
use axum::Json;
use jtc_host::explain::{Page, find, named, pages};
use utoipa::ToSchema;

/// Page about a code.
#[derive(Clone, Debug, serde::Serialize, ToSchema)]
pub(super) struct PageObject {
    /// Name of the code, unique; as in `error_codes` of the status.
    pub code: String,
    /// Title for display.
    pub title: String,
    /// Text of the page, as `jtc explain` prints it: meaning, usual cause, remedy and next command.
    pub text: String,
    /// Names of other pages that match the request.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub also: Vec<String>,
}

impl From<&Page> for PageObject {
    fn from(page: &Page) -> Self {
        Self { code: page.name.to_owned(), title: page.title(), text: page.to_string(), also: Vec::new() }
    }
}

/// Returns all pages about codes.
#[utoipa::path(
    get,
    path = "/api/explain",
    operation_id = "list_codes",
    responses((status = 200, description = "Pages, one for each code", body = Vec<PageObject>), Refusals)
)]
pub(super) async fn list() -> Json<Vec<PageObject>> {
    Json(pages().map(PageObject::from).collect())
}

/// Returns the page about a code.
#[utoipa::path(
    get,
    path = "/api/explain/{code}",
    operation_id = "explain",
    params((
        "code" = String, Path,
        description = "Name of a code; also the words that a screen shows, a number as `can:0x100`, or words of a name, as for `jtc explain`"
    )),
    responses(
        (status = 200, description = "Page that matches best", body = PageObject),
        (status = 404, description = "No page matches", body = Problem),
        Refusals
    )
)]
pub(super) async fn explain(Number(code): Number<String>) -> Result<Json<PageObject>, Problem> {
    // A page with exactly this name has priority over pages that contain the same words.
    let fitting = named(&code).map_or_else(|| find(&code), |page| vec![page]);
    let (first, others) = fitting.split_first().ok_or_else(|| {
        let message = format!("no page explains \"{}\"", agent_kit::gate::plain(&code));
        Problem::nothing("code", "with this name", "/api/explain").message(message)
    })?;
    let also = others.iter().map(|page| page.name.to_owned()).collect();
    Ok(Json(PageObject { also, ..PageObject::from(*first) }))
}
