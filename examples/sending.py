"""Sends frames as datagrams to a graph with `--source socket`, and hears its verdicts.

It needs nothing but Python's own library.
"""

import pathlib
import socket
import time

import vigil_types as vigil
from waiting import LOOK_NS, Waiting, graph_start

# Channel list where no graph of this machine tells its own.
ROVER = pathlib.Path(__file__).with_name("rover.channels")


class SocketPublisher:
    """Sends the frames of a robot to a graph.

    `to`: the name of a graph on this machine; or host:port of its UDP socket, or the path of its Unix socket.
    `SocketPublisher(name)` waits for that graph. `channels` is the channel list; with an address, the file `channels`.
    `publish(frame)` never waits, nor does `verdict()`. While nobody listens it says so, and goes on by itself when
    somebody does.
    """

    def __init__(self, to="rover", channels=ROVER):
        self.is_name = "/" not in to and ":" not in to
        self.waiting, self._sender, self._start, self._look_ns = Waiting(to), None, None, 0
        if self.is_name:
            while not self._is_found(time.monotonic_ns()):
                time.sleep(0.1)
        else:
            self.channels = vigil.Channels.read(channels)
            self._aim(to)

    def publish(self, frame, due_ns=0):
        """Fills in the header and sends the frame; False if nobody listens.

        `due_ns`: when the frame was due, CLOCK_MONOTONIC of the graph's machine; left out, the graph derives it. A
        capture time of 0 becomes now.
        """
        now_ns = time.monotonic_ns()
        if self.is_name and now_ns >= self._look_ns and not self._is_found(now_ns):
            return False
        if self._sender is None:
            return False
        frame.header.epoch, frame.header.seq = self._epoch, self._seq
        frame.header.t_schedule_ns, frame.header.t_publish_ns = due_ns, 0
        frame.header.t_capture_ns = frame.header.t_capture_ns or now_ns
        self._seq += 1
        try:
            # Each time anew: a Unix socket that was made again is another one.
            self._sender.connect(self._to)
            self._sender.send(vigil.datagram(frame))
        except OSError as error:
            self.waiting.tell(f"a graph at {self._to} ({error.strerror})")
            return False
        self.waiting.end()
        return True

    def verdict(self):
        """The newest verdict that has arrived since the last call; None if none has. Never waits.

        The robot obeys it for `valid_for_ns` from now, and stops after that.
        """
        newest = None
        while self._sender is not None:
            try:
                data = self._sender.recv(4096)
            except ConnectionRefusedError:
                # Nobody listens where the last frame went; `publish` says so.
                continue
            except OSError:
                # Nothing waits.
                break
            newest = vigil.verdict_of(data) or newest
        return newest

    def _is_found(self, now_ns):
        """Looks for the graph of this name; takes the address of the one that there is."""
        self._look_ns = now_ns + LOOK_NS
        start = graph_start(self.waiting.graph)
        if start is None:
            return self._lose()
        if start == self._start:
            return True
        try:
            address = vigil.addresses(self.waiting.graph)[0]
            self.channels = vigil.channel_list(self.waiting.graph)
        except FileNotFoundError:
            return self._lose()
        except LookupError:
            return self._lose(f"graph '{self.waiting.graph}' with '--source socket'")
        self._aim(address)
        self._start = start
        self.waiting.end()
        return True

    def _lose(self, what=None):
        """There is no graph to send to; says what it waits for."""
        self._sender = self._start = None
        self.waiting.tell(what)
        return False

    def _aim(self, to):
        """Sends there from now on: another start, whose numbers begin anew."""
        if "/" in to:
            family, self._to = socket.AF_UNIX, to
        else:
            host, port = to.rsplit(":", 1)
            family, self._to = socket.AF_INET6 if ":" in host else socket.AF_INET, (host.strip("[]"), int(port))
        self._sender = socket.socket(family, socket.SOCK_DGRAM)
        if family == socket.AF_UNIX:
            # A name of the kernel's choice: a socket without one gets no verdicts.
            self._sender.bind("")
        # A queue that is full holds up no robot.
        self._sender.setblocking(False)
        self._epoch, self._seq = time.monotonic_ns(), 0
