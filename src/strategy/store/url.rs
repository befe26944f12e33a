//! Where a database is.

use super::error::StoreError;
use std::path::{Path, PathBuf};

/// A database as sqlx shall open it.
#[derive(Debug)]
pub(super) struct Target {
    /// URL as the user gave it.
    pub(super) given: String,
    /// URL for sqlx.
    pub(super) url: String,
    /// The file, when it is SQLite on disk.
    pub(super) file: Option<PathBuf>,
}

impl Target {
    pub(super) fn sqlite(&self) -> bool {
        self.url.starts_with("sqlite:")
    }

    pub(super) fn parse(url: &str) -> Result<Self, StoreError> {
        if let Some(rest) = url.strip_prefix("sqlite:") {
            let path = rest.trim_start_matches("//").split('?').next().unwrap_or_default();
            // `sqlite:///x` is absolute, `sqlite://x` relative; trimming keeps the third slash.
            let path =
                if rest.starts_with("///") { format!("/{}", path.trim_start_matches('/')) } else { path.to_owned() };
            if path.is_empty() {
                return Err(StoreError::Url { url: shown(url) });
            }
            let file = (path != ":memory:").then(|| PathBuf::from(path));
            let mode = if url.contains('?') { "" } else { "?mode=rwc" };
            let given = url;
            let url = if file.is_some() { format!("{url}{mode}") } else { url.to_owned() };
            return Ok(Self { given: given.to_owned(), url, file });
        }
        match url.split_once("://") {
            Some(("mysql" | "mariadb", rest)) if rest.contains('/') => {
                Ok(Self { given: url.to_owned(), url: url.to_owned(), file: None })
            }
            _ => Err(StoreError::Url { url: shown(url) }),
        }
    }
}

/// The URL with its password hidden, fit for messages.
pub fn shown(url: &str) -> String {
    let Some((scheme, rest)) = url.split_once("://") else {
        return url.to_owned();
    };
    // The last @ before the first / of the path ends the user's part, whatever the password holds.
    let authority_end = rest.rfind('@').unwrap_or(0);
    match rest[..authority_end].split_once(':') {
        Some((user, _)) => format!("{scheme}://{user}:***{}", &rest[authority_end..]),
        None => url.to_owned(),
    }
}

/// The database of a cell that names none: a SQLite file in the user's state folder,
/// `$XDG_STATE_HOME/tandem/<cell>.db` or `~/.local/state/tandem/<cell>.db`. Makes the
/// folder, readable by its owner only.
///
/// # Errors
/// Neither variable is set, or the folder cannot be made.
pub fn default_url(cell: &str) -> Result<String, StoreError> {
    let folder = state_folder()?;
    make_folder(&folder)?;
    Ok(format!("sqlite://{}", folder.join(format!("{cell}.db")).display()))
}

/// Where what lasts is kept for this user: `$XDG_STATE_HOME/tandem`, or `~/.local/state/tandem`.
///
/// # Errors
/// Neither variable is set.
pub fn state_folder() -> Result<PathBuf, StoreError> {
    let absolute = |name: &str| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let state = absolute("XDG_STATE_HOME").or_else(|| absolute("HOME").map(|home| home.join(".local/state")));
    Ok(state.ok_or(StoreError::NoStateFolder)?.join("tandem"))
}

fn make_folder(folder: &Path) -> Result<(), StoreError> {
    use std::os::unix::fs::DirBuilderExt;
    std::fs::DirBuilder::new()
        .recursive(true)
        .mode(0o700)
        .create(folder)
        .map_err(|error| StoreError::Folder { path: folder.display().to_string(), why: error.to_string() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_password_is_never_shown() {
        assert_eq!(shown("mysql://cell:s3:cr@t@db.local:3306/tandem"), "mysql://cell:***@db.local:3306/tandem");
        assert_eq!(shown("mysql://cell@db.local/tandem"), "mysql://cell@db.local/tandem");
        assert_eq!(shown("sqlite:///var/lib/tandem/a.db"), "sqlite:///var/lib/tandem/a.db");
    }

    #[test]
    fn a_url_is_understood_or_refused() {
        let file = |url| Target::parse(url).map(|target| (target.url, target.file)).map_err(|error| error.to_string());
        assert_eq!(
            file("sqlite:///tmp/a.db"),
            Ok(("sqlite:///tmp/a.db?mode=rwc".into(), Some(PathBuf::from("/tmp/a.db"))))
        );
        assert_eq!(file("sqlite://a.db"), Ok(("sqlite://a.db?mode=rwc".into(), Some(PathBuf::from("a.db")))));
        assert_eq!(file("sqlite::memory:"), Ok(("sqlite::memory:".into(), None)));
        assert_eq!(file("mysql://u:p@h/d"), Ok(("mysql://u:p@h/d".into(), None)));
        assert_eq!(
            file("postgres://u:p@h/d"),
            Err("store.url = \"postgres://u:***@h/d\", allowed sqlite://FILE or mysql://USER@HOST/DATABASE; write it so"
                .into())
        );
    }
}
