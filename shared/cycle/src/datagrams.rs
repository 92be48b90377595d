//! Sockets on which datagrams arrive, none of which ever blocks.

use std::cell::{Cell, RefCell};
use std::fs;
use std::io;
use std::net::{SocketAddr, UdpSocket};
use std::os::fd::{AsRawFd, RawFd};
use std::os::unix::fs::FileTypeExt;
use std::os::unix::net::{SocketAddr as UnixAddr, UnixDatagram};
use std::path::{Path, PathBuf};

use crate::wake::{INPUTS, Inputs, NOTHING};

/// Where a datagram came from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum From {
    /// A port of this or another machine.
    Udp(SocketAddr),
    /// A process of this machine that may write to the socket's file.
    Unix,
}

/// A UDP socket, a Unix datagram socket, or both.
#[derive(Debug)]
pub struct Datagrams {
    udp: Option<UdpSocket>,
    unix: Option<UnixDatagram>,
    file: Option<PathBuf>,
    /// Whose turn it is to be read first: neither socket is to wait for the other.
    is_unix_first: Cell<bool>,
    /// What arrives at the Unix socket stays in the kernel.
    is_unix_shut: Cell<bool>,
    /// Whose datagram was the last at the Unix socket: a socket without a name cannot be answered.
    unix_peer: RefCell<Option<UnixAddr>>,
}

/// Datagrams that are thrown away at most when the Unix socket is opened again: more than its queue
/// holds.
const STALE_MAX: usize = 4096;

impl Datagrams {
    /// Binds them; a socket's file that a process has left behind is replaced.
    ///
    /// # Errors
    /// The system's, with the address.
    pub fn bind(udp: Option<SocketAddr>, unix: Option<&Path>) -> io::Result<Self> {
        let at = |address: String| {
            move |error: io::Error| io::Error::new(error.kind(), format!("{address}: {error}"))
        };
        let udp = match udp {
            None => None,
            Some(address) => {
                let socket = UdpSocket::bind(address).map_err(at(format!("udp {address}")))?;
                socket.set_nonblocking(true)?;
                Some(socket)
            }
        };
        let (mut unix_socket, mut file) = (None, None);
        if let Some(path) = unix {
            if fs::symlink_metadata(path).is_ok_and(|m| m.file_type().is_socket()) {
                fs::remove_file(path)?;
            }
            let socket =
                UnixDatagram::bind(path).map_err(at(format!("unix {}", path.display())))?;
            socket.set_nonblocking(true)?;
            unix_socket = Some(socket);
            file = Some(path.to_owned());
        }
        Ok(Self {
            udp,
            unix: unix_socket,
            file,
            is_unix_first: Cell::new(false),
            is_unix_shut: Cell::new(false),
            unix_peer: RefCell::new(None),
        })
    }

    /// Address of the UDP socket.
    #[must_use]
    pub fn udp_address(&self) -> Option<SocketAddr> {
        self.udp.as_ref()?.local_addr().ok()
    }

    /// Takes the next waiting datagram into `buffer`: how long it was, at most the buffer's length,
    /// and where it came from. `None` if none waits.
    pub fn receive(&self, buffer: &mut [u8]) -> Option<(usize, From)> {
        let is_unix_first = !self.is_unix_first.get();
        self.is_unix_first.set(is_unix_first);
        if is_unix_first {
            self.receive_unix(buffer)
                .or_else(|| self.receive_udp(buffer))
        } else {
            self.receive_udp(buffer)
                .or_else(|| self.receive_unix(buffer))
        }
    }

    fn receive_udp(&self, buffer: &mut [u8]) -> Option<(usize, From)> {
        let udp = self.udp.as_ref()?;
        loop {
            match udp.recv_from(buffer) {
                Ok((length, from)) => return Some((length, From::Udp(from))),
                // Something else about the last one that was sent.
                Err(e) if e.kind() == io::ErrorKind::ConnectionRefused => {}
                Err(_) => return None,
            }
        }
    }

    fn receive_unix(&self, buffer: &mut [u8]) -> Option<(usize, From)> {
        if self.is_unix_shut.get() {
            return None;
        }
        let (length, peer) = self.unix.as_ref()?.recv_from(buffer).ok()?;
        *self.unix_peer.borrow_mut() = Some(peer).filter(|peer| !peer.is_unnamed());
        Some((length, From::Unix))
    }

    /// Sends a datagram back; false if nobody takes it. Of several programs that use the Unix
    /// socket, the one that sent last is meant.
    pub fn answer(&self, to: From, bytes: &[u8]) -> bool {
        let sent = match to {
            From::Udp(peer) => self.udp.as_ref().map(|udp| udp.send_to(bytes, peer)),
            From::Unix => {
                let peer = self.unix_peer.borrow();
                let (unix, peer) = (self.unix.as_ref(), peer.as_ref());
                unix.zip(peer)
                    .map(|(unix, peer)| unix.send_to_addr(bytes, peer))
            }
        };
        sent.is_some_and(|sent| sent.is_ok())
    }

    /// From now on what comes from elsewhere stays in the kernel: nobody is woken by it.
    ///
    /// # Errors
    /// The system's.
    pub fn only(&self, from: From) -> io::Result<()> {
        self.is_unix_shut.set(from != From::Unix);
        let Some(udp) = &self.udp else {
            return Ok(());
        };
        let own = udp.local_addr()?;
        if own.ip().is_unspecified() {
            // It would be bound to one of this machine's addresses, and deaf to what the peer sends
            // to another of them, or to all: the comparison of addresses is left to the caller.
            return Ok(());
        }
        match from {
            From::Udp(peer) => udp.connect(peer),
            // From itself: nobody else has that address.
            From::Unix => udp.connect(own),
        }
    }

    /// From now on they may come from anywhere again; what has waited meanwhile is old and goes:
    /// how many datagrams that were.
    pub fn from_anywhere(&self) -> usize {
        let mut old = 0;
        if self.is_unix_shut.replace(false) {
            let mut buffer = [0; 1];
            let mut waiting = (0..STALE_MAX).map(|_| self.receive_unix(&mut buffer));
            while waiting.next().flatten().is_some() {
                old += 1;
            }
        }
        let Some(udp) = &self.udp else { return old };
        let nobody = libc::sockaddr {
            sa_family: libc::AF_UNSPEC as u16,
            sa_data: [0; 14],
        };
        // SAFETY: the descriptor is the socket's, the address is a valid one of its kind and
        // outlives the call. Failure leaves the peer as it was.
        #[allow(unsafe_code)]
        unsafe {
            libc::connect(
                udp.as_raw_fd(),
                &raw const nobody,
                size_of::<libc::sockaddr>() as libc::socklen_t,
            );
        }
        old
    }
}

impl Inputs for std::rc::Rc<Datagrams> {
    fn descriptors(&self) -> [RawFd; INPUTS] {
        let udp = self.udp.as_ref().map_or(NOTHING, AsRawFd::as_raw_fd);
        let unix = self.unix.as_ref().filter(|_| !self.is_unix_shut.get());
        let unix = unix.map_or(NOTHING, AsRawFd::as_raw_fd);
        [udp, unix, NOTHING]
    }
}

impl Drop for Datagrams {
    fn drop(&mut self) {
        if let Some(file) = &self.file {
            let _ = fs::remove_file(file);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Everything that waits; loopback delivers before the sender's call returns.
    fn received(datagrams: &Datagrams) -> Vec<(Vec<u8>, From)> {
        let mut buffer = [0; 8];
        let mut all = Vec::new();
        while let Some((length, from)) = datagrams.receive(&mut buffer) {
            all.push((buffer[..length].to_vec(), from));
        }
        all
    }

    #[test]
    fn what_comes_from_elsewhere_waits_in_the_kernel_and_is_gone_afterwards() {
        let path = std::env::temp_dir().join(format!("elsewhere-{}", std::process::id()));
        let local = "127.0.0.1:0".parse().unwrap();
        let datagrams = std::rc::Rc::new(Datagrams::bind(Some(local), Some(&path)).unwrap());
        let to = datagrams.udp_address().unwrap();
        let source = UdpSocket::bind(local).unwrap();
        let from = From::Udp(source.local_addr().unwrap());
        let other = UnixDatagram::unbound().unwrap();
        datagrams.only(from).unwrap();
        other.send_to(b"other", &path).unwrap();
        source.send_to(b"ours", to).unwrap();
        assert_eq!(received(&datagrams), [(b"ours".to_vec(), from)]);
        assert_eq!(datagrams.descriptors()[1], NOTHING);
        assert_eq!(datagrams.from_anywhere(), 1);
        assert_eq!(received(&datagrams), []);
        other.send_to(b"new", &path).unwrap();
        assert_eq!(received(&datagrams), [(b"new".to_vec(), From::Unix)]);
        assert_ne!(datagrams.descriptors()[1], NOTHING);
    }

    #[test]
    fn both_sockets_receive_and_the_file_goes_with_them() {
        let path = std::env::temp_dir().join(format!("datagrams-{}", std::process::id()));
        // Left behind by a process that has died.
        std::mem::forget(UnixDatagram::bind(&path).unwrap());
        let local = "127.0.0.1:0".parse().unwrap();
        let datagrams = Datagrams::bind(Some(local), Some(&path)).unwrap();
        assert_eq!(received(&datagrams), []);
        let sender = UnixDatagram::unbound().unwrap();
        sender.send_to(b"one", &path).unwrap();
        let udp = UdpSocket::bind(local).unwrap();
        let to = datagrams.udp_address().unwrap();
        udp.send_to(b"longer than the buffer", to).unwrap();
        let from = From::Udp(udp.local_addr().unwrap());
        // Either may be first.
        let mut found = received(&datagrams);
        found.sort_by_key(|(_, from)| *from == From::Unix);
        let expected = [(b"longer t".to_vec(), from), (b"one".to_vec(), From::Unix)];
        assert_eq!(found, expected);
        drop(datagrams);
        assert!(!path.exists());
        fs::write(&path, "not a socket").unwrap();
        assert!(Datagrams::bind(None, Some(&path)).is_err());
        fs::remove_file(&path).unwrap();
    }

    #[test]
    fn whoever_has_an_address_is_answered() {
        let path = std::env::temp_dir().join(format!("answers-{}", std::process::id()));
        let local = "127.0.0.1:0".parse().unwrap();
        let datagrams = Datagrams::bind(Some(local), Some(&path)).unwrap();
        let (udp, mut buffer) = (UdpSocket::bind(local).unwrap(), [0; 8]);
        let from = From::Udp(udp.local_addr().unwrap());
        udp.send_to(b"one", datagrams.udp_address().unwrap())
            .unwrap();
        assert_eq!(received(&datagrams), [(b"one".to_vec(), from)]);
        datagrams.only(from).unwrap();
        assert!(datagrams.answer(from, b"answer"));
        assert_eq!(udp.recv(&mut buffer).unwrap(), 6);
        assert!(!datagrams.answer(From::Unix, b"nobody"));
        datagrams.from_anywhere();
        let (own, unnamed) = (path.with_extension("own"), UnixDatagram::unbound().unwrap());
        let named = UnixDatagram::bind(&own).unwrap();
        for (sender, is_answered) in [(&unnamed, false), (&named, true), (&unnamed, false)] {
            sender.send_to(b"two", &path).unwrap();
            assert_eq!(received(&datagrams), [(b"two".to_vec(), From::Unix)]);
            assert_eq!(datagrams.answer(From::Unix, b"back"), is_answered);
        }
        assert_eq!(named.recv(&mut buffer).unwrap(), 4);
        fs::remove_file(own).unwrap();
    }

    #[test]
    fn who_listens_everywhere_hears_a_peer_at_each_of_its_addresses() {
        let datagrams = Datagrams::bind(Some("0.0.0.0:0".parse().unwrap()), None).unwrap();
        let port = datagrams.udp_address().unwrap().port();
        let peer = UdpSocket::bind("127.0.0.1:0").unwrap();
        let from = From::Udp(peer.local_addr().unwrap());
        for (to, sent) in [("127.0.0.1", b"one"), ("127.0.0.2", b"two")] {
            peer.send_to(sent, (to, port)).unwrap();
            assert_eq!(received(&datagrams), [(sent.to_vec(), from)]);
            datagrams.only(from).unwrap();
        }
    }

    #[test]
    fn a_chosen_peer_is_the_only_one_until_it_is_let_go() {
        let local: SocketAddr = "127.0.0.1:0".parse().unwrap();
        // A port that is asked for by its number stays with the socket; one that is free is found
        // by asking for any.
        let free = UdpSocket::bind(local).unwrap().local_addr().unwrap();
        let datagrams = Datagrams::bind(Some(free), None).unwrap();
        let to = datagrams.udp_address().unwrap();
        let [chosen, other] = [(); 2].map(|()| UdpSocket::bind(local).unwrap());
        let from = From::Udp(chosen.local_addr().unwrap());
        datagrams.only(from).unwrap();
        let _ = other.send_to(b"no", to);
        chosen.send_to(b"yes", to).unwrap();
        assert_eq!(received(&datagrams), [(b"yes".to_vec(), from)]);
        datagrams.from_anywhere();
        assert_eq!(datagrams.udp_address(), Some(to));
        // The first call may still hear that the last datagram was refused.
        let _ = other.send_to(b"no", to);
        received(&datagrams);
        other.send_to(b"now", to).unwrap();
        let from = From::Udp(other.local_addr().unwrap());
        let all = received(&datagrams);
        assert_eq!(all.last(), Some(&(b"now".to_vec(), from)));
    }
}
