//! Two cells side by side, peers that do not belong, and what must not be found.

use tandem_bus::{BusError, Identity, Node, Read, Write};
use tandem_msg::{Header, JointCommand, JointState, Stamp};

use crate::{PATIENCE, Scratch, hear, identity};

/// Two instances speak the same service names and never hear each other; removing one leaves the other alone.
#[test]
fn two_instances_side_by_side_do_not_meet() {
    let (one, two) = (Scratch::new(), Scratch::new());
    let (node_one, node_two) = (one.node("plant", 1), two.node("plant", 1));
    let mut writer_one = node_one.publisher::<JointState>("arm/state").expect("a free service");
    let mut writer_two = node_two.publisher::<JointState>("arm/state").expect("a free service");
    let mut reader_one = node_one.latest::<JointState>("arm/state").expect("a free service");
    let mut reader_two = node_two.latest::<JointState>("arm/state").expect("a free service");

    writer_one.publish(Stamp(1), &JointState::default()).expect("a free slot");
    hear(&mut reader_one, Header::heard);
    assert!(!reader_two.read().header.heard());

    drop((node_one, writer_one, reader_one));
    one.instance.remove().expect("nobody uses it");
    assert!(one.instance.shared_memory().is_empty());
    assert!(!two.instance.shared_memory().is_empty());
    writer_two.publish(Stamp(1), &JointState::default()).expect("a free slot");
    hear(&mut reader_two, Header::heard);
}

/// A process of another configuration is refused when it opens, with both values, not when it speaks.
#[test]
fn another_configuration_is_refused() {
    let scratch = Scratch::new();
    let node = scratch.node("plant", 1);
    let _writer = node.publisher::<JointState>("arm/state").expect("a free service");
    let stranger = Identity { config_hash: 8, ..identity("controller", 1) };
    let stranger = Node::new(&scratch.instance, stranger, PATIENCE);
    let refused = stranger.latest::<JointState>("arm/state").err().expect("another configuration");
    assert_eq!(
        refused.to_string(),
        "service arm/state: controller cannot open it to read: config is 0000000000000007 there and \
         0000000000000008 here; all processes of a cell must be of one build and one configuration"
    );
}

/// A service carries one message type; another is refused as a difference of schema.
#[test]
fn another_message_type_is_refused() {
    let scratch = Scratch::new();
    let node = scratch.node("plant", 1);
    let _writer = node.publisher::<JointState>("arm/state").expect("a free service");
    let refused = node.latest::<JointCommand>("arm/state").err().expect("another type");
    assert!(matches!(refused, BusError::Mismatch { field: "schema", .. }), "{refused:?}");
}

/// A third writer of one service is refused within the deadline, and the error says what to do.
#[test]
fn more_writers_than_one_and_its_successor_are_refused_in_time() {
    let scratch = Scratch::new();
    let patience = std::time::Duration::from_millis(50);
    let node = Node::new(&scratch.instance, identity("plant", 1), patience);
    let open = || node.publisher::<JointState>("arm/state");
    let (_first, _second) = (open().expect("a free service"), open().expect("room for a successor"));
    let start = std::time::Instant::now();
    let refused = open().err().expect("no room for a third");
    assert!(start.elapsed() < PATIENCE, "{:?}", start.elapsed());
    assert!(refused.to_string().starts_with("service arm/state: plant cannot write it: "), "{refused}");
}
