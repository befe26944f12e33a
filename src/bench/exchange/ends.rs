//! One side of an exchange, by each way.

#![allow(unsafe_code)]

use std::time::{Duration, Instant};

use tandem_bus::direct::{Blackboard, DirectError, Payload, PubSub};
use tandem_bus::{Identity, Instance, Latest, Node, Publisher, Read as _, Write as _};
use tandem_msg::{Header, Message, Stamp};

use super::Way;
use super::lanes::{Lanes, Side};
use crate::bench::BenchError;

/// No answer by then, and the other side is taken for dead.
const PATIENCE: Duration = Duration::from_secs(5);
/// Looks between two looks at the clock.
const LOOKS: u32 = 1 << 16;
/// The services, to the other process and back.
const SERVICES: [&str; 2] = ["bench/there", "bench/back"];

/// One side of an exchange.
pub(in crate::bench) trait End {
    /// Meets the other side, which is there now.
    fn connect(&mut self) -> Result<(), BenchError> {
        Ok(())
    }

    /// Sends a message that holds a number.
    fn send(&mut self, number: u64) -> Result<(), BenchError>;

    /// Waits for the next message.
    fn receive(&mut self) -> Result<u64, BenchError>;
}

/// Opens a side; the first one makes what both use.
pub(in crate::bench) fn open(way: Way, instance: &Instance, first: bool) -> Result<Box<dyn End>, BenchError> {
    let [out, inward] = if first { SERVICES } else { [SERVICES[1], SERVICES[0]] };
    Ok(match way {
        Way::Raw | Way::Futex => {
            let path = instance.shared_file("lanes");
            let lanes = Lanes::open(&path, first).map_err(BenchError::io(path.display().to_string()))?;
            let (side, blocking) = (Side::new(lanes, first), way == Way::Futex);
            Box::new(Lane { side, blocking })
        }
        Way::Iceoryx => {
            let ports = PubSub::open(instance, out, inward).map_err(failed)?;
            // The numbers are counted on both sides: as upstream's benchmark does, nothing is written into the sample.
            Box::new(Counted { ports, first, sent: 0, received: 0 })
        }
        Way::Blackboard => {
            let open = if first { Blackboard::create } else { Blackboard::open };
            Box::new(Board { board: open(instance, out, inward).map_err(failed)?, last: 0 })
        }
        Way::Bus => {
            let identity = Identity { role: "bench".to_owned(), epoch: 1, config_hash: 0 };
            let node = Node::new(instance, identity, PATIENCE);
            Box::new(Bus { out: node.publisher(out)?, inward: node.latest(inward)?, last: 0, _node: node })
        }
    })
}

fn failed(error: DirectError) -> BenchError {
    BenchError::peer("iceoryx2", error.to_string())
}

/// Looks until there is something.
fn spin<T>(mut look: impl FnMut() -> Result<Option<T>, BenchError>) -> Result<T, BenchError> {
    let began = Instant::now();
    loop {
        for _ in 0..LOOKS {
            if let Some(found) = look()? {
                return Ok(found);
            }
            std::hint::spin_loop();
        }
        if began.elapsed() > PATIENCE {
            return Err(BenchError::peer("the other process", format!("has not answered within {PATIENCE:?}")));
        }
    }
}

struct Lane {
    side: Side,
    blocking: bool,
}

impl End for Lane {
    fn send(&mut self, number: u64) -> Result<(), BenchError> {
        self.side.send(number);
        if self.blocking {
            self.side.wake();
        }
        Ok(())
    }

    fn receive(&mut self) -> Result<u64, BenchError> {
        if self.blocking {
            let began = Instant::now();
            loop {
                if let Some(number) = self.side.received() {
                    return Ok(number);
                }
                if began.elapsed() > PATIENCE {
                    return Err(BenchError::peer("the other process", format!("has not answered within {PATIENCE:?}")));
                }
                self.side.sleep();
            }
        }
        spin(|| Ok(self.side.received()))
    }
}

struct Counted {
    ports: PubSub,
    first: bool,
    sent: u64,
    received: u64,
}

impl Counted {
    /// What the other side's message of that count means: rests and the end follow from the count alone.
    fn meant(&self, count: u64) -> u64 {
        if count.is_multiple_of(super::BURST) { count | super::RESTING } else { count }
    }
}

impl End for Counted {
    fn connect(&mut self) -> Result<(), BenchError> {
        self.ports.connect().map_err(failed)
    }

    fn send(&mut self, number: u64) -> Result<(), BenchError> {
        if number & super::ENDING != 0 {
            // A message of which nothing is read cannot say so; the process is ended when its value is dropped.
            return Ok(());
        }
        self.sent += 1;
        self.ports.send().map_err(failed)
    }

    fn receive(&mut self) -> Result<u64, BenchError> {
        let ports = &self.ports;
        spin(|| Ok(ports.received().map_err(failed)?.then_some(())))?;
        self.received += 1;
        let count = self.meant(self.received);
        Ok(if self.first { count & !super::RESTING } else { count })
    }
}

struct Board {
    board: Blackboard,
    last: u64,
}

impl End for Board {
    fn send(&mut self, number: u64) -> Result<(), BenchError> {
        let mut payload = Payload::default();
        payload.0[0] = number;
        self.board.write(payload);
        Ok(())
    }

    fn receive(&mut self) -> Result<u64, BenchError> {
        let (board, last) = (&self.board, self.last);
        self.last = spin(|| Ok(Some(board.read().0[0]).filter(|number| *number != last)))?;
        Ok(self.last)
    }
}

/// 96 bytes, as a message of a cell begins.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C)]
struct Ping {
    header: Header,
    number: u64,
    more: [u64; 7],
}

const _: () = assert!(size_of::<Ping>() == 96 && size_of::<Payload>() == 96);

// SAFETY: `repr(C)`, plain numbers only.
unsafe impl Message for Ping {
    const NAME: &'static str = "tandem::bench::Ping";

    fn header(&self) -> &Header {
        &self.header
    }

    fn header_mut(&mut self) -> &mut Header {
        &mut self.header
    }
}

struct Bus {
    out: Publisher<Ping>,
    inward: Latest<Ping>,
    last: u64,
    /// Ports live no longer than their node.
    _node: Node,
}

impl End for Bus {
    fn connect(&mut self) -> Result<(), BenchError> {
        // Connected by a thread of its own; what is published before is heard then.
        Ok(())
    }

    fn send(&mut self, number: u64) -> Result<(), BenchError> {
        let ping = Ping { number, more: [number; 7], ..Ping::default() };
        self.out
            .publish(Stamp(number), &ping)
            .map(drop)
            .map_err(|unsent| BenchError::peer("the bus", format!("{unsent:?}")))
    }

    fn receive(&mut self) -> Result<u64, BenchError> {
        let (inward, last) = (&mut self.inward, self.last);
        // Those who connect run at ordinary priority: they need the processors until both sides have met.
        if last == 0 {
            inward.wait(PATIENCE);
        }
        let number = spin(|| {
            let ping = inward.read();
            Ok((ping.header.seq != last).then_some((ping.header.seq, ping.number)))
        })?;
        self.last = number.0;
        Ok(number.1)
    }
}
