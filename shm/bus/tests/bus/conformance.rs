//! What holds on every bus, in shared memory and inside one process.

use tandem_bus::{Read, Slot, Write};
use tandem_msg::{CLOUD_POINTS, Header, JointState, PointCloud, Stamp};

use crate::{CONFIG_HASH, Scratch, hear, identity, within_patience};

/// A bus with one service of each message the suite needs.
trait Fixture {
    fn joints(&self, epoch: u64) -> impl Write<JointState>;
    fn joints_reader(&self) -> impl Read<JointState>;
    fn cloud(&self) -> impl Write<PointCloud>;
    fn cloud_reader(&self) -> impl Read<PointCloud>;
}

struct InShared(Scratch);

impl Fixture for InShared {
    fn joints(&self, epoch: u64) -> impl Write<JointState> {
        self.0.node("plant", epoch).publisher("arm/state").expect("a free service")
    }
    fn joints_reader(&self) -> impl Read<JointState> {
        self.0.node("controller", 1).latest("arm/state").expect("a free service")
    }
    fn cloud(&self) -> impl Write<PointCloud> {
        self.0.node("plant", 1).lender("camera/cloud").expect("a free service")
    }
    fn cloud_reader(&self) -> impl Read<PointCloud> {
        self.0.node("perception", 1).borrower("camera/cloud").expect("a free service")
    }
}

#[derive(Default)]
struct InProcess {
    joints: Slot<JointState>,
    cloud: Slot<PointCloud>,
}

impl Fixture for InProcess {
    fn joints(&self, epoch: u64) -> impl Write<JointState> {
        self.joints.writer(&identity("plant", epoch))
    }
    fn joints_reader(&self) -> impl Read<JointState> {
        self.joints.reader()
    }
    fn cloud(&self) -> impl Write<PointCloud> {
        self.cloud.writer(&identity("plant", 1))
    }
    fn cloud_reader(&self) -> impl Read<PointCloud> {
        self.cloud.reader()
    }
}

fn at(position: f64) -> JointState {
    JointState { position: [position; 8], ..JointState::default() }
}

/// Before the first value a reader sees one that was never heard, and does not wait.
fn nothing_is_heard_before_the_first(bus: &impl Fixture) {
    let mut reader = bus.joints_reader();
    assert!(!reader.read().header.heard());
    let _writer = bus.joints(1);
    assert!(!reader.read().header.heard());
}

/// The header is the bus's: numbers from 1, the stamp given, epoch and configuration of the writer.
fn the_bus_fills_the_header(bus: &impl Fixture) {
    let (mut writer, mut reader) = (bus.joints(3), bus.joints_reader());
    let forged = JointState { header: Header { seq: 99, epoch: 99, ..Header::default() }, ..at(0.5) };
    for seq in 1..=3 {
        let sent = writer.publish(Stamp(seq * 1_000), &forged).expect("a free slot");
        let expected = Header { seq, stamp: Stamp(seq * 1_000), epoch: 3, config_hash: CONFIG_HASH };
        assert_eq!(sent, expected);
        assert_eq!(hear(&mut reader, |header| header.seq == seq), JointState { header: expected, ..at(0.5) });
    }
}

/// A slow reader sees the last value only; a fast one sees it again.
fn the_latest_value_is_all_there_is(bus: &impl Fixture) {
    let (mut writer, mut reader) = (bus.joints(1), bus.joints_reader());
    for k in 1..=1_000_u32 {
        writer.publish(Stamp(u64::from(k)), &at(f64::from(k))).expect("writers never wait for readers");
    }
    assert_eq!(hear(&mut reader, Header::heard).position[0], 1_000.0);
    assert_eq!(reader.read().position[0], 1_000.0);
    assert_eq!(reader.held().header.seq, 1_000);
}

/// Who comes late sees what was said last.
fn a_late_reader_hears_the_last_value(bus: &impl Fixture) {
    let mut writer = bus.joints(1);
    writer.publish(Stamp(1), &at(1.0)).expect("a free slot");
    let mut reader = bus.joints_reader();
    assert_eq!(hear(&mut reader, Header::heard).position[0], 1.0);
    writer.publish(Stamp(2), &at(2.0)).expect("a free slot");
    assert_eq!(reader.read().position[0], 2.0, "once connected, at once");
}

/// A restarted writer counts from 1 in a higher epoch and is believed; its predecessor no more.
fn a_restarted_writer_is_believed_and_the_old_one_no_more(bus: &impl Fixture) {
    let mut reader = bus.joints_reader();
    let mut old = bus.joints(1);
    for k in 1..=5 {
        old.publish(Stamp(k), &at(1.0)).expect("a free slot");
    }
    assert_eq!(hear(&mut reader, Header::heard).header.seq, 5);
    let mut new = bus.joints(2);
    new.publish(Stamp(6), &at(2.0)).expect("a free slot");
    let header = hear(&mut reader, |header| header.epoch == 2).header;
    assert_eq!(header.seq, 1);
    // The frozen predecessor wakes up and speaks once more.
    old.publish(Stamp(7), &at(1.0)).expect("a free slot");
    let read = reader.read();
    assert_eq!(read.position[0], 2.0, "{:?}", read.header);
}

/// A successor that has opened its end and waits for its turn takes nobody's place before it speaks: not with readers
/// that knew its predecessor, nor with those that come meanwhile.
fn a_successor_that_waits_silences_nobody(bus: &impl Fixture) {
    let (mut old, mut early) = (bus.joints(1), bus.joints_reader());
    old.publish(Stamp(1), &at(1.0)).expect("a free slot");
    hear(&mut early, |header| header.epoch == 1);
    let mut successor = bus.joints(2);
    let mut late = bus.joints_reader();
    // Long enough for everybody to be connected.
    let mut said = 1;
    let mut say = || {
        said += 1;
        old.publish(Stamp(said), &at(1.0)).expect("a free slot");
        said
    };
    within_patience("the late one is connected", || {
        let said = say();
        late.read().header.seq == said
    });
    for _ in 0..100 {
        let said = say();
        assert_eq!((early.read().header.seq, late.read().header.seq), (said, said));
    }
    successor.publish(Stamp(1_000), &at(2.0)).expect("a free slot");
    for reader in [&mut early, &mut late] {
        assert_eq!(hear(reader, |header| header.epoch == 2).position[0], 2.0);
    }
}

/// Two readers of one service do not take values from each other.
fn readers_are_independent(bus: &impl Fixture) {
    let (mut first, mut second) = (bus.joints_reader(), bus.joints_reader());
    let mut writer = bus.joints(1);
    writer.publish(Stamp(1), &at(1.0)).expect("a free slot");
    assert_eq!(hear(&mut first, Header::heard).position[0], 1.0);
    assert_eq!(hear(&mut second, Header::heard).position[0], 1.0);
}

/// A cloud is written in place, point by point, and arrives whole.
fn a_cloud_is_written_in_place(bus: &impl Fixture) {
    let (mut writer, mut reader) = (bus.cloud(), bus.cloud_reader());
    for round in 1..=10_u16 {
        let value = f32::from(round);
        writer
            .publish_with(Stamp(u64::from(round)), |cloud| {
                cloud.request = u32::from(round);
                cloud.point_count = CLOUD_POINTS as u32;
                cloud.points.fill([value; 3]);
            })
            .expect("a free slot");
        let cloud = reader.read();
        assert_eq!((cloud.request, cloud.header.seq), (u32::from(round), u64::from(round)));
        assert!(cloud.points.iter().all(|point| *point == [value; 3]), "round {round}");
    }
}

fn conforms<B: Fixture>(fresh: impl Fn() -> B) {
    nothing_is_heard_before_the_first(&fresh());
    the_bus_fills_the_header(&fresh());
    the_latest_value_is_all_there_is(&fresh());
    a_late_reader_hears_the_last_value(&fresh());
    a_restarted_writer_is_believed_and_the_old_one_no_more(&fresh());
    a_successor_that_waits_silences_nobody(&fresh());
    readers_are_independent(&fresh());
    a_cloud_is_written_in_place(&fresh());
}

#[test]
fn shared_memory_conforms() {
    conforms(|| InShared(Scratch::new()));
}

#[test]
fn one_process_conforms() {
    conforms(InProcess::default);
}
