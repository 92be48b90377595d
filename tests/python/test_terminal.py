"""What people have at a terminal: the live view, completions, man pages."""

import fcntl
import os
import pathlib
import pty
import re
import select
import signal
import struct
import subprocess
import tempfile
import termios
import time
import unittest

from harness import BINARIES, ROOT, WATCHDOG_S, Graph, vigil


class Terminal:
    """A program on a terminal of its own; ended at the end of a `with`."""

    def __init__(self, *words, columns=80, lines=24, **environment):
        self.outer, inner = pty.openpty()
        self.resize(columns, lines)
        environment = {**os.environ, "TERM": "xterm-256color", **environment}
        # The terminal is that of a session of its own: resizing it sends the program a signal.
        take = lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0)
        self.program = subprocess.Popen(
            words, cwd=ROOT, env=environment, stdin=inner, stdout=inner, stderr=inner,
            start_new_session=True, preexec_fn=take,
        )
        os.close(inner)
        self.text = ""

    def resize(self, columns, lines):
        fcntl.ioctl(self.outer, termios.TIOCSWINSZ, struct.pack("HHHH", lines, columns, 0, 0))

    def press(self, keys):
        os.write(self.outer, keys.encode())

    def read_until(self, wanted):
        """Reads until `wanted`, which may be anywhere in what was written since the last call."""
        until = time.monotonic() + WATCHDOG_S
        self.text = ""
        while not re.search(wanted, self.text):
            assert time.monotonic() < until, f"{wanted} is not in {self.text!r}"
            if select.select([self.outer], [], [], 0.1)[0]:
                try:
                    self.text += os.read(self.outer, 1 << 16).decode(errors="replace")
                except OSError:
                    # The program has closed it.
                    assert re.search(wanted, self.text), f"{wanted} is not in {self.text!r}"
        return self.text

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.program.poll() is None:
            self.program.kill()
        self.program.wait()
        os.close(self.outer)


class LiveView(unittest.TestCase):
    def test_it_draws_explains_follows_the_terminals_size_and_ends(self):
        with Graph("--inject", "stuck:RM@4", "--duration", "90") as graph:
            graph.wait_until_up()
            with Terminal(BINARIES / "vigil", "top", "--graph", graph.name) as top:
                drawn = top.read_until("RM_STUCK")
                self.assertIn("\x1b[?1049h", drawn, "the screen before comes back")
                self.assertIn(graph.name, drawn)
                top.press("?")
                top.read_until("scroll the events")
                for columns, lines in [(200, 60), (20, 5), (1, 1), (80, 24)]:
                    top.resize(columns, lines)
                    time.sleep(0.3)
                    self.assertIsNone(top.program.poll(), (columns, lines))
                top.press("?")
                top.press("q")
                top.read_until(r"\x1b\[\?1049l")
                self.assertEqual(top.program.wait(WATCHDOG_S), 0)

    def test_a_signal_ends_it_and_gives_the_terminal_back(self):
        with Graph("--duration", "90") as graph:
            graph.wait_until_up()
            for sent in [signal.SIGINT, signal.SIGTERM, signal.SIGHUP]:
                with Terminal(BINARIES / "vigil", "top", "--graph", graph.name) as top:
                    top.read_until("detector")
                    top.program.send_signal(sent)
                    top.read_until(r"\x1b\[\?1049l")
                    self.assertEqual(top.program.wait(WATCHDOG_S), 0, sent)

    def test_without_colour_no_colour_is_sent(self):
        with Graph("--duration", "90") as graph:
            graph.wait_until_up()
            words = [BINARIES / "vigil", "top", "--graph", graph.name]
            with Terminal(*words, NO_COLOR="1") as top:
                plain = top.read_until("detector")
            with Terminal(*words) as top:
                coloured = top.read_until("detector")
            colour = re.compile(r"\x1b\[[0-9;]*[34]8;[25];")
            self.assertIsNone(colour.search(plain), plain)
            self.assertIsNotNone(colour.search(coloured), coloured)


class Shells(unittest.TestCase):
    def test_completions_know_the_commands_of_every_program_and_their_options(self):
        help = vigil("pomdp", "solve", "--help").stdout
        options = set(re.findall(r"--[a-z][a-z-]+", help)) - {"--help"}
        self.assertGreater(len(options), 3, help)
        for shell in ["bash", "zsh", "fish"]:
            text = vigil("completions", shell).stdout
            for option in options:
                self.assertIn(option.removeprefix("--"), text, shell)
            self.assertIn("check-publisher", text, shell)

    def test_each_command_of_every_program_has_a_page(self):
        with tempfile.TemporaryDirectory() as folder:
            done = vigil("man", folder)
            self.assertEqual(done.returncode, 0, done.stderr)
            folder = pathlib.Path(folder)
            for name in ["vigil", "vigil-run", "vigil-learn", "vigil-pomdp", "vigil-pomdp-solve"]:
                page = (folder / f"{name}.1").read_text()
                self.assertIn(name.replace("-", "\\-"), page)
            self.assertIn("\\-\\-frames", (folder / "vigil-learn.1").read_text())

    def test_bash_completes_options_of_a_nested_command(self):
        script = vigil("completions", "bash").stdout + (
            "\nCOMP_WORDS=(vigil pomdp solve --)\nCOMP_CWORD=3\n_vigil vigil -- solve\n"
            'printf "%s\\n" "${COMPREPLY[@]}"\n'
        )
        done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, timeout=WATCHDOG_S)
        self.assertIn("--json", done.stdout.split(), done.stderr)

    def test_help_of_a_command_is_that_of_its_option(self):
        for words in [["status"], ["pomdp", "solve"], []]:
            self.assertEqual(vigil("help", *words).stdout, vigil(*words, "--help").stdout)


if __name__ == "__main__":
    unittest.main()
