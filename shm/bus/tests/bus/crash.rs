//! Processes that die without saying so. The helper is this same binary, started with the name of a test that does
//! nothing unless it is told which part to play.

use std::fs;
use std::io::{BufRead, BufReader, Write as _};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use tandem_bus::{Cleaned, Instance, Node, Read, Write, leftovers};
use tandem_msg::{JointState, Stamp};

use crate::{PATIENCE, Scratch, hear, identity, root, within_patience};

const PART: &str = "TANDEM_BUS_TEST_PART";
const READY: &str = "ready";

/// The helper's main: opens a writer, publishes once, says so, and holds still until its input closes or it is killed.
#[test]
fn helper() {
    let Ok(part) = std::env::var(PART) else { return };
    let [id, directory, epoch] = part.split('|').collect::<Vec<_>>()[..] else { panic!("{part}") };
    let instance = Instance::new(id, &root(Path::new(directory))).expect("as the parent named it");
    let epoch: u64 = epoch.parse().expect("a number");
    let node = Node::new(&instance, identity("plant", epoch), PATIENCE);
    let mut writer = node.publisher::<JointState>("arm/state").expect("a place for a writer");
    writer.publish(Stamp(epoch), &JointState::default()).expect("a free slot");
    println!("\n{READY}");
    std::io::stdout().flush().expect("the parent listens");
    for line in std::io::stdin().lines() {
        // Each line asks for one more publication.
        let Ok(line) = line else { break };
        writer.publish(Stamp(line.parse().expect("a stamp")), &JointState::default()).expect("a free slot");
        println!("\n{READY}");
    }
}

struct Helper(Child, BufReader<std::process::ChildStdout>);

impl Helper {
    fn start(scratch: &Scratch, epoch: u64) -> Self {
        let binary = std::env::current_exe().expect("this test");
        let mut child = Command::new(binary)
            .args(["--exact", "crash::helper", "--nocapture"])
            .env(PART, format!("{}|{}|{epoch}", scratch.instance.id(), scratch.path().display()))
            .current_dir(scratch.path())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("this test can be started again");
        let output = BufReader::new(child.stdout.take().expect("piped"));
        let mut helper = Self(child, output);
        helper.wait_ready();
        helper
    }

    fn wait_ready(&mut self) {
        let mut line = String::new();
        while self.1.read_line(&mut line).expect("text") != 0 {
            if line.trim_end() == READY {
                return;
            }
            line.clear();
        }
        panic!("the helper ended before it was ready: {:?}", self.0.wait());
    }

    fn publish(&mut self, stamp: u64) {
        writeln!(self.0.stdin.as_mut().expect("piped"), "{stamp}").expect("the helper listens");
        self.wait_ready();
    }

    fn kill(mut self) {
        self.0.kill().expect("it runs");
        self.0.wait().expect("it is ours");
    }
}

/// A writer is killed and restarted again and again under a reader that stays. Each successor finds a place, is heard in
/// its own epoch, and what the dead left is cleaned: files and shared memory do not grow.
#[test]
fn a_killed_writer_is_cleaned_up_and_its_successor_heard() {
    let scratch = Scratch::new();
    let node = scratch.node("controller", 1);
    let mut reader = node.latest::<JointState>("arm/state").expect("a free service");
    let mut before = None;
    for epoch in 1..=6 {
        let mut helper = Helper::start(&scratch, epoch);
        helper.publish(1_000 + epoch);
        let header = hear(&mut reader, |header| header.stamp == Stamp(1_000 + epoch)).header;
        assert_eq!(header.epoch, epoch);
        helper.kill();
        assert_eq!(reader.read().header, header, "the last value of a dead writer stays readable");
        assert_eq!(scratch.instance.clean_dead(PATIENCE), Cleaned { removed: 1, remaining: 0 });
        assert_eq!(scratch.instance.clean_dead(PATIENCE), Cleaned::default(), "nothing is cleaned twice");
        let count = || (scratch.instance.shared_memory().len(), files(scratch.instance.root()));
        let first = *before.get_or_insert_with(count);
        // What the reader still held of the dead is let go of when it is connected to the living.
        within_patience("objects and files are as after the first round", || count() <= first);
    }
}

/// When every process of a cell was killed, its objects can be seen, named and removed.
#[test]
fn what_a_whole_dead_cell_left_is_found_and_removed() {
    let scratch = Scratch::new();
    Helper::start(&scratch, 1).kill();
    let id = scratch.instance.id();
    assert!(leftovers().iter().any(|object| object.instance == id), "{:?}", leftovers());
    scratch.instance.remove().expect("nobody uses it");
    assert!(!leftovers().iter().any(|object| object.instance == id), "{:?}", leftovers());
    assert!(!scratch.instance.root().exists());
    scratch.instance.remove().expect("removing twice is no error");
}

/// iceoryx2 would read `config/iceoryx2.toml` of the working directory, and our tree has a `config/`. It must not matter.
#[test]
fn a_configuration_file_in_the_working_directory_is_not_picked_up() {
    let scratch = Scratch::new();
    let strange = format!("strange-{}-", std::process::id());
    fs::create_dir(scratch.path().join("config")).expect("writable");
    let file = format!("[global]\nprefix = \"{strange}\"\nroot-path = \"{}/elsewhere\"\n", scratch.path().display());
    fs::write(scratch.path().join("config/iceoryx2.toml"), file).expect("writable");
    let helper = Helper::start(&scratch, 1);
    assert!(!scratch.instance.shared_memory().is_empty(), "the helper is on our bus");
    helper.kill();
    scratch.instance.clean_dead(PATIENCE);
    let found = |name: &str| name.contains(&strange);
    let names = fs::read_dir("/dev/shm").expect("readable").flatten().map(|entry| entry.file_name());
    let strangers: Vec<_> = names.filter(|name| found(&name.to_string_lossy())).collect();
    assert!(strangers.is_empty(), "{strangers:?}");
    assert!(!scratch.path().join("elsewhere").exists());
}

fn files(directory: &Path) -> usize {
    fs::read_dir(directory).map_or(0, |entries| {
        entries.flatten().map(|entry| if entry.path().is_dir() { files(&entry.path()) } else { 1 }).sum()
    })
}
