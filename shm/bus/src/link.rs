//! The thread that keeps a process connected, so that no cycle has to.
//!
//! iceoryx2 does what takes time where it is called: a peer that comes or goes is
//! mapped or unmapped inside `send` and `receive`. So all ports of channels live on
//! a thread of their own, at ordinary priority. It opens services, hands each new
//! writer's channel over to the reader by one pointer, and gives a channel back only
//! when its reader has moved on. A cycle touches shared memory and nothing else.
//!
//! ```text
//! Publisher ──stores──▶ Channel ◀──loads── Latest          in the cycle
//!     ▲                    │                 ▲
//!     └─────── link ───────┴────── link ─────┘              every TEND: who has come or gone?
//! ```

#![allow(unsafe_code)]

use std::ptr::{NonNull, null_mut};
use std::sync::Arc;
use std::sync::atomic::{AtomicPtr, AtomicU64, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread::JoinHandle;
use std::time::Duration;

use iceoryx2::port::publisher::Publisher as Port;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::ipc;
use iceoryx2::sample::Sample;
use tandem_msg::Message;

use crate::BusError;
use crate::channel::Channel;

/// Between two looks at who has come or gone: a tenth of how long a command is valid.
const TEND: Duration = Duration::from_millis(2);
/// Channels taken in at one look: of the two writers a service has room for, and one.
const TAKEN_MAX: usize = 3;

type InnerNode = iceoryx2::node::Node<ipc::Service>;
type Job = Box<dyn FnOnce(&mut Desk) + Send>;

/// What the thread works on.
pub(crate) struct Desk {
    pub(crate) node: InnerNode,
    ports: Vec<(u64, Box<dyn Tended>)>,
    count: u64,
}

/// A port that is looked after.
trait Tended {
    /// Connects to who has come, lets go of who has gone.
    fn tend(&mut self);
}

/// The thread; ended with the last port that uses it.
pub(crate) struct Link {
    jobs: Option<mpsc::Sender<Job>>,
    thread: Option<JoinHandle<()>>,
}

impl Link {
    /// Starts the thread, whose node is made by `join`.
    pub(crate) fn start(
        join: impl FnOnce() -> Result<InnerNode, BusError> + Send + 'static,
    ) -> Result<Arc<Self>, BusError> {
        let (jobs, orders) = mpsc::channel::<Job>();
        let (ready, joined) = mpsc::channel();
        let thread = std::thread::Builder::new().name("bus".to_owned()).spawn(move || {
            let node = match join() {
                Ok(node) => node,
                Err(error) => {
                    let _ = ready.send(Err(error));
                    return;
                }
            };
            let _ = ready.send(Ok(()));
            Desk { node, ports: Vec::new(), count: 0 }.run(&orders);
        });
        let link = Self { jobs: Some(jobs), thread: Some(thread.map_err(BusError::Thread)?) };
        // A thread that has panicked has dropped its end; the message stands on standard error.
        joined.recv().unwrap_or(Err(BusError::Ended))?;
        Ok(Arc::new(link))
    }

    /// Has `job` done on the thread and waits for its answer.
    pub(crate) fn ask<T: Send + 'static>(
        &self,
        job: impl FnOnce(&mut Desk) -> T + Send + 'static,
    ) -> Result<T, BusError> {
        let (answer, answered) = mpsc::channel();
        self.order(Box::new(move |desk| {
            let _ = answer.send(job(desk));
        }));
        answered.recv().map_err(|_| BusError::Ended)
    }

    fn order(&self, job: Job) {
        if let Some(jobs) = &self.jobs {
            // Without the thread there is nothing left to do.
            let _ = jobs.send(job);
        }
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        self.jobs = None;
        if let Some(thread) = self.thread.take() {
            // Its files are removed before the process goes on, and perhaps ends.
            let _ = thread.join();
        }
    }
}

impl Desk {
    fn run(mut self, orders: &mpsc::Receiver<Job>) {
        loop {
            match orders.recv_timeout(TEND) {
                Ok(job) => job(&mut self),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return,
            }
            self.ports.iter_mut().for_each(|(_, port)| port.tend());
        }
    }

    /// Makes the channel of a new writer and looks after its port; `None` when the port gives no memory for it.
    pub(crate) fn keep_writer<M: Message>(
        &mut self,
        port: Port<ipc::Service, Channel<M>, ()>,
        epoch: u64,
    ) -> Option<(u64, Place<M>)> {
        let mut loan = port.loan_uninit().ok()?;
        let place = loan.payload_mut().as_mut_ptr();
        // SAFETY: loaned to us and not sent yet.
        unsafe { Channel::initialise(place, epoch) };
        // SAFETY: initialised above.
        unsafe { loan.assume_init() }.send().ok()?;
        // Sent once and for ever: as nothing else is sent on this port, the sample stays in its history, and the
        // memory with it, for as long as the port lives.
        let place = Place(NonNull::new(place)?);
        Some((self.keep(Writing { port }), place))
    }

    /// Looks after the port of a reader, and hands the channels it finds to the other end.
    pub(crate) fn keep_reader<M: Message>(
        &mut self,
        port: Subscriber<ipc::Service, Channel<M>, ()>,
    ) -> (u64, Arc<Door<M>>) {
        let door = Arc::new(Door::default());
        let reading = Reading { port, held: Vec::new(), door: Arc::clone(&door) };
        (self.keep(reading), door)
    }

    fn keep(&mut self, port: impl Tended + 'static) -> u64 {
        self.count += 1;
        self.ports.push((self.count, Box::new(port)));
        self.count
    }
}

/// Where a channel lies: valid for as long as the port it comes from is looked after.
pub(crate) struct Place<M>(pub(crate) NonNull<Channel<M>>);

// SAFETY: an address; the channel is shared between threads and processes by design.
unsafe impl<M: Message> Send for Place<M> {}

/// One end's claim on its port; given up when dropped.
pub(crate) struct Claim {
    pub(crate) link: Arc<Link>,
    pub(crate) port: u64,
}

impl Drop for Claim {
    fn drop(&mut self) {
        let closed = self.port;
        self.link.order(Box::new(move |desk| desk.ports.retain(|(port, _)| *port != closed)));
    }
}

struct Writing<M: Message> {
    port: Port<ipc::Service, Channel<M>, ()>,
}

impl<M: Message> Tended for Writing<M> {
    fn tend(&mut self) {
        // Delivers the channel to readers that have come. What failed is tried at the next look.
        let _ = self.port.update_connections();
    }
}

/// Through which a channel is handed from the link to a reader's cycle.
pub(crate) struct Door<M> {
    /// By the link: the channel to read.
    offered: AtomicPtr<Channel<M>>,
    /// By the reader: the channel it reads.
    taken: AtomicPtr<Channel<M>>,
    /// By the link: looks that found a connection broken.
    failures: AtomicU64,
}

impl<M> Default for Door<M> {
    fn default() -> Self {
        Self { offered: AtomicPtr::new(null_mut()), taken: AtomicPtr::new(null_mut()), failures: AtomicU64::new(0) }
    }
}

impl<M: Message> Door<M> {
    /// The channel to read, once there is one, and whether it has just become another.
    /// The one before must not be used any more. A new writer's is entered once something was published in it: until
    /// then its predecessor may still be at work.
    ///
    /// # Realtime
    /// Three loads, and a store when it has changed.
    pub(crate) fn enter(&self) -> Option<(&Channel<M>, bool)> {
        let (offered, taken) = (self.offered.load(Ordering::Acquire), self.taken.load(Ordering::Relaxed));
        if taken != offered {
            // SAFETY: null, or a sample the link holds until that or a newer one was taken, which only the caller of
            // this does: while the reference lives, `self` is borrowed and this method is not called by its one reader.
            if let Some(channel) = unsafe { offered.as_ref() }.filter(|channel| channel.has_published()) {
                // Released: whatever was read of the channel before has been read.
                self.taken.store(offered, Ordering::Release);
                return Some((channel, true));
            }
        }
        // SAFETY: as above; what is taken is held.
        unsafe { taken.as_ref() }.map(|channel| (channel, false))
    }

    pub(crate) fn failures(&self) -> u64 {
        self.failures.load(Ordering::Relaxed)
    }
}

type Held<M> = Sample<ipc::Service, Channel<M>, ()>;

struct Reading<M: Message> {
    port: Subscriber<ipc::Service, Channel<M>, ()>,
    /// By the incarnation of their writers: the one that is read, and newer ones.
    held: Vec<Held<M>>,
    door: Arc<Door<M>>,
}

impl<M: Message> Reading<M> {
    fn take(&mut self, sample: Held<M>) {
        sample.payload().touch();
        let epoch = sample.payload().epoch();
        let place = self.held.partition_point(|held| held.payload().epoch() <= epoch);
        self.held.insert(place, sample);
    }

    /// Lets go of the writers before the one that is read, and offers the newest. Until the reader has read one at
    /// all, only one that has published.
    fn offer(&mut self) {
        let place = |held: &Held<M>| std::ptr::from_ref(held.payload()).cast_mut();
        let taken = self.door.taken.load(Ordering::Acquire);
        if let Some(read) = self.held.iter().position(|held| place(held) == taken) {
            self.held.drain(..read);
        }
        let mut newest = self.held.iter().rev();
        if let Some(held) = newest.find(|held| !taken.is_null() || held.payload().has_published()) {
            self.door.offered.store(place(held), Ordering::Release);
        }
    }
}

impl<M: Message> Tended for Reading<M> {
    fn tend(&mut self) {
        for _ in 0..TAKEN_MAX {
            match self.port.receive() {
                Ok(Some(sample)) => self.take(sample),
                Ok(None) => break,
                Err(_) => {
                    self.door.failures.fetch_add(1, Ordering::Relaxed);
                    break;
                }
            }
        }
        self.offer();
    }
}

impl<M: Message> Drop for Reading<M> {
    fn drop(&mut self) {
        // The reader's end is gone (`Claim`); its samples go before their port.
        self.held.clear();
    }
}
