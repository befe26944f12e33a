//! One suite for both databases: whatever the store promises, it keeps on SQLite and on MariaDB.
//!
//! SQLite is always tested. MariaDB is tested on a private server that this program starts
//! and ends itself, when `mariadbd` is installed; otherwise it says that it was skipped.

mod mariadb;

use mariadb::Server;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Command, Stdio};
use tandem::strategy::store::{RunRecord, Store, StoreError};
use tandem::strategy::{JournalEntry, Library, StepState};
use tandem_config::{Cell, StrategyRow};

/// Set for the process that is killed; names its database.
const VICTIM: &str = "TANDEM_TEST_STORE_VICTIM";

fn seeds() -> Vec<StrategyRow> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/cells/s471.toml");
    Cell::load(&file, None).unwrap_or_else(|faults| panic!("{faults}")).strategies
}

fn entry(seq: u64, step: u32, state: StepState) -> JournalEntry {
    JournalEntry {
        seq,
        run: "run".into(),
        serial: "s471-run-0001".into(),
        step,
        attempt: 1,
        part: "bottom_shell".into(),
        state,
        time_s: 1.25 * seq as f64,
        duration_s: 0.5,
        subject: "robot".into(),
        class: "smooth_hole".into(),
        confidence: 0.97,
        mode: "insert".into(),
        tool: "parallel_gripper".into(),
        form: "robot".into(),
        strategy: "robot_seat/smooth_hole/insert/parallel_gripper".into(),
        clearance_min_m: (state == StepState::Done).then_some(0.0123),
        remark: String::new(),
    }
}

/// A promise by name; it is given the URL of an empty database.
type Promise = (&'static str, fn(&str));

/// What a store promises.
const PROMISES: [Promise; 8] = [
    ("a_second_start_finds_what_the_first_left", a_second_start_finds_what_the_first_left),
    ("the_library_follows_its_files_and_keeps_the_users_rows", the_library_follows_its_files_and_keeps_the_users_rows),
    ("four_first_starts_at_once", four_first_starts_at_once),
    ("a_line_written_twice_is_one_line", a_line_written_twice_is_one_line),
    ("what_is_not_finite_is_refused", what_is_not_finite_is_refused),
    ("the_case_of_an_id_does_not_matter", the_case_of_an_id_does_not_matter),
    ("a_run_is_recorded_once_and_ends", a_run_is_recorded_once_and_ends),
    ("what_was_acknowledged_survives_kill_9", what_was_acknowledged_survives_kill_9),
];

#[test]
fn sqlite_keeps_every_promise() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (name, promise) in PROMISES {
        println!("{name}");
        promise(&format!("sqlite://{}", folder.path().join(format!("{name}.db")).display()));
    }
}

#[test]
fn mariadb_keeps_every_promise() {
    let Some(server) = Server::start() else {
        println!("skipped: mariadb not installed");
        return;
    };
    for (name, promise) in PROMISES {
        println!("{name}");
        promise(&server.database(name));
    }
}

fn a_second_start_finds_what_the_first_left(url: &str) {
    let wanted = Library::new(seeds());
    for _ in 0..2 {
        let store = Store::open(url).expect("opens");
        store.seed(&seeds()).expect("seeds");
        assert_eq!(store.library().expect("reads"), wanted, "{url}");
    }
}

fn the_library_follows_its_files_and_keeps_the_users_rows(url: &str) {
    let store = Store::open(url).expect("opens");
    let mut rows = seeds();
    store.seed(&rows).expect("seeds");
    let mut own = rows[0].clone();
    own.id = "mine/other/lay/vacuum_gripper".into();
    own.mass.max = 3.5;
    store.import(std::slice::from_ref(&own)).expect("imports");
    rows.truncate(3);
    rows[1].distance.max = 0.25;
    store.seed(&rows).expect("seeds again");
    rows.push(own);
    assert_eq!(store.library().expect("reads"), Library::new(rows), "{url}");
}

/// Four processes at once meet an empty database: each finds its tables, none fails.
fn four_first_starts_at_once(url: &str) {
    let results: Vec<_> = std::thread::scope(|scope| {
        let starts: Vec<_> = (0..4)
            .map(|_| {
                scope.spawn(|| {
                    let store = Store::open(url)?;
                    store.seed(&seeds())?;
                    store.library().map(|library| library.len())
                })
            })
            .collect();
        starts.into_iter().map(|start| start.join().expect("does not panic")).collect()
    });
    for result in results {
        assert_eq!(result.map_err(|error| error.to_string()), Ok(seeds().len()), "{url}");
    }
}

fn a_line_written_twice_is_one_line(url: &str) {
    let store = Store::open(url).expect("opens");
    let lines = [entry(1, 0, StepState::Started), entry(2, 1, StepState::Started)];
    store.append(&lines).expect("appends");
    store.append(&lines).expect("appends again");
    store.append(&[entry(3, 0, StepState::Done)]).expect("replaces the first");
    let read = store.journal("run").expect("reads");
    assert_eq!(read, [entry(2, 1, StepState::Started), entry(3, 0, StepState::Done)], "{url}");
}

fn what_is_not_finite_is_refused(url: &str) {
    let store = Store::open(url).expect("opens");
    for value in [f64::NAN, f64::INFINITY] {
        let bad = JournalEntry { confidence: value, ..entry(2, 1, StepState::Done) };
        let refused = store.append(&[entry(1, 0, StepState::Started), bad]);
        let message =
            format!("journal s471-run-0001/1/1: confidence = {value}, allowed finite numbers; nothing was written");
        assert_eq!(refused.map_err(|error| error.to_string()), Err(message), "{url}");
        assert_eq!(store.journal("run").expect("reads"), [], "{url}");
    }
    let mut row = seeds()[0].clone();
    row.mass.max = f64::NAN;
    let refused = store.import(&[row]);
    assert!(matches!(refused, Err(StoreError::NotFinite { field: "mass", .. })), "{url}: {refused:?}");
}

/// Ids are kept in lower case, so that both databases agree on what is the same.
fn the_case_of_an_id_does_not_matter(url: &str) {
    let store = Store::open(url).expect("opens");
    let shouted = JournalEntry { serial: "S471-RUN-0001".into(), run: "RUN".into(), ..entry(1, 0, StepState::Started) };
    store.append(&[shouted]).expect("appends");
    store.append(&[entry(2, 0, StepState::Done)]).expect("replaces it");
    assert_eq!(store.journal("Run").expect("reads"), [entry(2, 0, StepState::Done)], "{url}");
}

fn a_run_is_recorded_once_and_ends(url: &str) {
    let store = Store::open(url).expect("opens");
    let run = RunRecord {
        id: "run".into(),
        cell: "s471".into(),
        product: "s471".into(),
        config_hash: u64::MAX - 1,
        seed: u64::MAX,
        boxes: 20,
        started_ns: 1_700_000_000_000_000_000,
    };
    store.begin(&run).expect("begins");
    store.begin(&run).expect("begins again");
    store.end("run", "completed").expect("ends");
    let runs = store.runs().expect("reads");
    assert_eq!(runs.len(), 1, "{url}");
    assert_eq!((&runs[0].record, runs[0].outcome.as_str()), (&run, "completed"), "{url}");
}

/// A process is killed in the middle of writing: every line it had been told is durable is there.
fn what_was_acknowledged_survives_kill_9(url: &str) {
    drop(Store::open(url).expect("makes the tables"));
    let mut victim = Command::new(std::env::current_exe().expect("own path"))
        .args(["--exact", "the_victim_writes_until_killed", "--nocapture"])
        .env(VICTIM, url)
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("starts the victim");
    let mut acknowledged = 0;
    let output = BufReader::new(victim.stdout.take().expect("its output"));
    for line in output.lines().map_while(Result::ok) {
        if let Some(seq) = line.strip_prefix("durable ").and_then(|seq| seq.parse::<u64>().ok()) {
            acknowledged = seq;
            if seq == 25 {
                victim.kill().expect("kills it"); // SIGKILL
            }
        }
    }
    victim.wait().expect("is gone");
    assert!(acknowledged >= 25, "{url}: the victim wrote {acknowledged} lines");
    let journal = Store::open(url).expect("opens after the kill").journal("run").expect("reads");
    let numbers: Vec<u64> = journal.iter().map(|entry| entry.seq).collect();
    let complete: Vec<u64> = (1..=numbers.len() as u64).collect();
    assert_eq!(numbers, complete, "{url}: no gap");
    assert!(numbers.len() as u64 >= acknowledged, "{url}: {acknowledged} acknowledged, {} there", numbers.len());
}

/// The process that is killed; nothing to do in an ordinary run of the tests.
#[test]
fn the_victim_writes_until_killed() {
    let Ok(url) = std::env::var(VICTIM) else { return };
    let store = Store::open(&url).expect("opens");
    for seq in 1..10_000 {
        store.append(&[entry(seq, seq as u32, StepState::Done)]).expect("appends");
        println!("durable {seq}");
        std::io::stdout().flush().expect("a pipe");
    }
}

#[test]
fn a_database_that_cannot_be_opened_says_what_to_do() {
    let message = |url: &str| Store::open(url).err().map(|error| error.to_string()).unwrap_or_default();
    assert_eq!(
        message("oracle://me:secret@host/db"),
        "store.url = \"oracle://me:***@host/db\", allowed sqlite://FILE or mysql://USER@HOST/DATABASE; write it so"
    );
    let nowhere = message("sqlite:///no/such/folder/tandem.db");
    assert_eq!(
        nowhere,
        "sqlite:///no/such/folder/tandem.db: could not open the database: error returned from database: \
         (code: 14) unable to open database file; name a file in a folder that exists and is writable"
    );
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("text.db");
    std::fs::write(&file, "this is no database, but long enough to be looked at as one ".repeat(20)).expect("writes");
    let damaged = message(&format!("sqlite://{}", file.display()));
    assert!(damaged.contains("the file is damaged or something else"), "{damaged}");
    let silent = message("mysql://me:secret@127.0.0.1:1/tandem");
    assert!(!silent.contains("secret") && silent.contains("me:***@127.0.0.1:1/tandem"), "{silent}");
    assert!(silent.ends_with("see whether the database runs and the URL is right"), "{silent}");
}

/// An applied migration that differs from this program's is named, and nothing is changed.
#[test]
fn tables_of_another_version_are_refused() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let url = format!("sqlite://{}", folder.path().join("other.db").display());
    drop(Store::open(&url).expect("opens"));
    sqlx::any::install_default_drivers();
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
    runtime.block_on(async {
        let pool = sqlx::AnyPool::connect(&url).await.expect("connects");
        let spoil = sqlx::query("UPDATE _sqlx_migrations SET checksum = x'00' WHERE version = 3");
        spoil.execute(&pool).await.expect("spoils it");
        pool.close().await;
    });
    let refused = Store::open(&url).err();
    assert!(matches!(refused, Some(StoreError::Version { version: 3, .. })), "{refused:?}");
}
