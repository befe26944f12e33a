//! The cell that was asked about: its files, its model, its database.

use std::path::Path;
use std::sync::mpsc;
use std::time::Duration;

use tandem_config::Cell;

use super::{Check, Host, Subject};
use crate::perception::Perception;
use crate::strategy::store::{Store, default_url, shown};

/// A database that has not answered by then is not there.
const ANSWER: Duration = Duration::from_secs(2);
const NOT_ASKED: &str = "no cell was named";
const ASK: &str = "name one: tandem doctor CELL.toml";

/// What was found of a cell.
#[derive(Clone, Debug)]
pub(super) struct CellFound {
    /// Its name, or what is wrong with its files.
    pub(super) files: Result<String, String>,
    /// Its model, or what is wrong with that; nothing when the files do not say which.
    pub(super) model: Option<Result<String, String>>,
    /// Its database, or what is wrong with that.
    pub(super) database: Option<Result<String, String>>,
}

/// Reads a cell's files and model, and asks its database.
pub(super) fn look(file: &Path) -> CellFound {
    let cell = match Cell::load(file, None) {
        Ok(cell) => cell,
        Err(faults) => return CellFound { files: Err(faults.to_string()), model: None, database: None },
    };
    let model = Perception::load(&cell.perception.model);
    CellFound {
        files: Ok(format!("{}: configuration {:016x}", cell.name, cell.hash)),
        model: Some(model.map(|_| cell.perception.model.display().to_string()).map_err(|error| error.to_string())),
        database: Some(ask(&cell)),
    }
}

/// Asked on a thread of its own: a server that hangs must not hang the doctor.
fn ask(cell: &Cell) -> Result<String, String> {
    let url = match &cell.store.url {
        Some(url) => url.clone(),
        None => default_url(&cell.name).map_err(|error| error.to_string())?,
    };
    let (answer, answered) = mpsc::channel();
    let asked = url.clone();
    std::thread::spawn(move || {
        // Nobody waits any more for an answer that comes late.
        let _ = answer.send(Store::open(&asked).map(drop).map_err(|error| error.to_string()));
    });
    match answered.recv_timeout(ANSWER) {
        Ok(answer) => answer.map(|()| shown(&url)),
        Err(_) => Err(format!("{} has not answered within {ANSWER:?}", shown(&url))),
    }
}

pub(super) fn files(host: &Host) -> Check {
    let it = Subject("cell", "a cell whose files are refused does not start");
    match host.cell.as_ref().map(|cell| &cell.files) {
        None => it.unknown(NOT_ASKED, ASK),
        Some(Ok(found)) => it.ok(found),
        Some(Err(faults)) => it.bad(faults, "correct the file; `tandem check CELL.toml` tells the same"),
    }
}

pub(super) fn model(host: &Host) -> Check {
    let it = Subject("model", "without its model, whole and as its card says, perception recognises nothing");
    let fix = "restore the file from the repository, or make it anew: tandem train encoder";
    depending(it, host, |cell| cell.model.as_ref(), fix)
}

pub(super) fn database(host: &Host) -> Check {
    let it = Subject("database", "no step begins before the journal entry of the last one is in the database");
    let fix = "start the server, or correct `[store] url` in the cell file";
    depending(it, host, |cell| cell.database.as_ref(), fix)
}

/// A check that needs the cell's files to be in order.
fn depending(
    it: Subject,
    host: &Host,
    part: impl Fn(&CellFound) -> Option<&Result<String, String>>,
    fix: &str,
) -> Check {
    match host.cell.as_ref().map(part) {
        None => it.unknown(NOT_ASKED, ASK),
        Some(None) => it.unknown("the cell's files do not say which", "correct the cell's files first"),
        Some(Some(Ok(found))) => it.ok(found),
        Some(Some(Err(error))) => it.bad(error, fix),
    }
}
