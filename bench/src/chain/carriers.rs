//! Ways to hand a block to another process.

use std::error::Error;
use std::fs::File;
use std::io::{self, ErrorKind, Read, Write};
use std::os::unix::fs::FileTypeExt;
use std::os::unix::net::UnixDatagram;
use std::path::Path;
use std::time::Duration;

use super::futex::FutexBlock;
use clap::ValueEnum;
use serde::{Deserialize, Serialize};
use vigil_cycle::{Clock, Monotonic};

use super::{Incoming, Outgoing, payload, sum_lines};

/// How blocks are handed over.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ValueEnum)]
#[value(rename_all = "kebab-case")]
pub enum Carrier {
    /// Shared memory and a bare futex: the floor.
    Futex,
    /// Vigil's own ports: iceoryx2's shared memory and its events.
    SharedMemory,
    /// Unix datagram sockets.
    Datagram,
    /// Named pipes.
    Pipe,
    /// A queue between threads of one process.
    Queue,
}

type OpenResult<T> = Result<Box<T>, Box<dyn Error>>;

impl Carrier {
    /// Opens the reading side behind stage `before`, which writes blocks of `size` bytes.
    ///
    /// # Errors
    /// The system's; a queue has no sides that could be opened apart.
    pub fn incoming(self, shared: &Path, before: usize, size: usize) -> OpenResult<dyn Incoming> {
        let path = shared.join(before.to_string());
        Ok(match self {
            Self::Futex => Box::new(FutexReader {
                block: FutexBlock::open(&path, size)?,
                last_read: 0,
            }),
            Self::SharedMemory => payload::incoming(shared, before, size)?,
            Self::Datagram => {
                let socket = UnixDatagram::bind(&path)?;
                copy_reader(size, move |bytes, limit| receive(&socket, bytes, limit))
            }
            Self::Pipe => {
                let mut pipe = open_pipe(&path, false)?;
                copy_reader(size, move |bytes, _| read_pipe(&mut pipe, bytes))
            }
            Self::Queue => return Err("a queue lies within one process".into()),
        })
    }

    /// Opens the writing side of `stage`.
    ///
    /// # Errors
    /// As [`Self::incoming`].
    pub fn outgoing(self, shared: &Path, stage: usize, size: usize) -> OpenResult<dyn Outgoing> {
        let path = shared.join(stage.to_string());
        // Nobody reads the last stage.
        let is_last = stage + 1 == super::STAGES;
        Ok(match self {
            Self::Futex => Box::new(FutexWriter {
                block: FutexBlock::open(&path, size)?,
            }),
            Self::SharedMemory => payload::outgoing(shared, stage, size)?,
            Self::Queue => return Err("a queue lies within one process".into()),
            _ if is_last => copy_writer(size, |_| Ok(())),
            Self::Datagram => {
                let socket = UnixDatagram::unbound()?;
                wait_for(&path)?;
                socket.connect(&path)?;
                copy_writer(size, move |bytes| socket.send(bytes).map(|_| ()))
            }
            Self::Pipe => {
                let mut pipe = open_pipe(&path, true)?;
                copy_writer(size, move |bytes| pipe.write_all(bytes))
            }
        })
    }
}

/// Bytes before the payload of a message: two instants.
const HEAD: usize = 16;

/// A block with its instants before it, for carriers that copy or hand on bytes.
#[derive(Debug, Default)]
pub struct Message(pub Vec<u8>);

impl Message {
    /// For a block of `size` bytes.
    #[must_use]
    pub fn new(size: usize) -> Self {
        Self(vec![0; HEAD + size])
    }

    /// Fills the block with one byte.
    pub fn fill(&mut self, byte: u8) {
        self.0[HEAD..].fill(byte);
    }

    /// Writes the instants; returns that of now, the publication's.
    pub fn stamp(&mut self, t_schedule_ns: u64) -> u64 {
        let t_publish_ns = Monotonic.now_ns();
        self.0[..8].copy_from_slice(&t_schedule_ns.to_le_bytes());
        self.0[8..HEAD].copy_from_slice(&t_publish_ns.to_le_bytes());
        t_publish_ns
    }

    /// Reads the instants.
    #[must_use]
    pub fn instants(&self) -> (u64, u64) {
        let number = |at: usize| {
            let mut bytes = [0; 8];
            bytes.copy_from_slice(&self.0[at..at + 8]);
            u64::from_le_bytes(bytes)
        };
        (number(0), number(8))
    }

    /// See [`Incoming::checksum`].
    #[must_use]
    pub fn checksum(&self) -> u64 {
        sum_lines(&self.0[HEAD..])
    }
}

fn wait_for(path: &Path) -> Result<(), Box<dyn Error>> {
    for _ in 0..2000 {
        if path.exists() {
            return Ok(());
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    Err(format!("{} never appeared", path.display()).into())
}

struct FutexReader {
    block: FutexBlock,
    last_read: u32,
}

impl Incoming for FutexReader {
    fn receive(&mut self, limit: Duration) -> Result<Option<(u64, u64)>, Box<dyn Error>> {
        self.block.wait(self.last_read, limit);
        let (newest, t_schedule_ns, t_publish_ns) = self.block.newest();
        let is_new = newest != self.last_read;
        self.last_read = newest;
        Ok(is_new.then_some((t_schedule_ns, t_publish_ns)))
    }

    fn checksum(&self) -> u64 {
        self.block.checksum()
    }
}

struct FutexWriter {
    block: FutexBlock,
}

impl Outgoing for FutexWriter {
    fn fill(&mut self, byte: u8) {
        self.block.fill(byte);
    }

    fn publish(&mut self, t_schedule_ns: u64) -> Result<u64, Box<dyn Error>> {
        let t_publish_ns = Monotonic.now_ns();
        self.block.publish(t_schedule_ns, t_publish_ns);
        Ok(t_publish_ns)
    }
}

/// Reads messages by copying them out of what the system holds.
struct CopyReader<R> {
    /// Fills a message within the limit; false if none came.
    read: R,
    message: Message,
}

impl<R: FnMut(&mut [u8], Duration) -> io::Result<bool>> Incoming for CopyReader<R> {
    fn receive(&mut self, limit: Duration) -> Result<Option<(u64, u64)>, Box<dyn Error>> {
        let has_come = (self.read)(&mut self.message.0, limit)?;
        Ok(has_come.then(|| self.message.instants()))
    }

    fn checksum(&self) -> u64 {
        self.message.checksum()
    }
}

/// Writes messages by having the system copy them.
struct CopyWriter<W> {
    write: W,
    message: Message,
}

impl<W: FnMut(&[u8]) -> io::Result<()>> Outgoing for CopyWriter<W> {
    fn fill(&mut self, byte: u8) {
        self.message.fill(byte);
    }

    fn publish(&mut self, t_schedule_ns: u64) -> Result<u64, Box<dyn Error>> {
        let t_publish_ns = self.message.stamp(t_schedule_ns);
        (self.write)(&self.message.0)?;
        Ok(t_publish_ns)
    }
}

fn copy_reader<R>(size: usize, read: R) -> Box<dyn Incoming>
where
    R: FnMut(&mut [u8], Duration) -> io::Result<bool> + 'static,
{
    let message = Message::new(size);
    Box::new(CopyReader { read, message })
}

fn copy_writer<W>(size: usize, write: W) -> Box<dyn Outgoing>
where
    W: FnMut(&[u8]) -> io::Result<()> + 'static,
{
    let message = Message::new(size);
    Box::new(CopyWriter { write, message })
}

/// Reads one datagram.
fn receive(socket: &UnixDatagram, bytes: &mut [u8], limit: Duration) -> io::Result<bool> {
    socket.set_read_timeout(Some(limit))?;
    match socket.recv(bytes) {
        Ok(_) => Ok(true),
        Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => Ok(false),
        Err(error) => Err(error),
    }
}

/// Waits until a message has come or the writer has gone: a pipe has no time limit.
fn read_pipe(pipe: &mut File, bytes: &mut [u8]) -> io::Result<bool> {
    match pipe.read_exact(bytes) {
        Ok(()) => Ok(true),
        Err(e) if e.kind() == ErrorKind::UnexpectedEof => Ok(false),
        Err(error) => Err(error),
    }
}

/// Opens a named pipe, which the first of its users makes.
fn open_pipe(path: &Path, is_writer: bool) -> Result<File, Box<dyn Error>> {
    let is_there = || std::fs::metadata(path).is_ok_and(|m| m.file_type().is_fifo());
    if !is_there() {
        // The other side may have been quicker.
        let status = std::process::Command::new("mkfifo")
            .arg(path)
            .stderr(std::process::Stdio::null())
            .status()?;
        if !status.success() && !is_there() {
            return Err(format!("mkfifo {}: {status}", path.display()).into());
        }
    }
    let mut options = std::fs::OpenOptions::new();
    // Opening waits for the other side.
    Ok(options.read(!is_writer).write(is_writer).open(path)?)
}
