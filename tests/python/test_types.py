"""The types of other languages are those of the Rust structs, and compile."""

import pathlib
import subprocess
import tempfile
import unittest

from harness import EXAMPLES, datagram_of, vigil

import vigil_types


class Types(unittest.TestCase):
    def test_the_checked_in_files_are_what_the_structs_say(self):
        for language, name in [("c", "vigil_types.h"), ("python", "vigil_types.py")]:
            made = vigil("types", language)
            self.assertEqual(made.returncode, 0, made.stderr)
            hint = f"run: vigil types {language} > examples/{name}"
            self.assertEqual((EXAMPLES / name).read_text(), made.stdout, hint)

    def test_the_header_compiles_and_makes_the_same_datagram_as_python(self):
        frame = vigil_types.SensorFrame(run_id=7, channel_valid=0b111)
        frame.header.epoch, frame.header.seq = 3, 11
        frame.channel[:3] = 1.5, -2.0, 0.25
        source = """
            #include "vigil_types.h"
            #include <stdio.h>
            int main(void) {
              vigil_sensor_frame frame;
              uint8_t bytes[VIGIL_DATAGRAM_SIZE];
              memset(&frame, 0, sizeof frame);
              frame.run_id = 7, frame.channel_valid = 7;
              frame.header.epoch = 3, frame.header.seq = 11;
              frame.channel[0] = 1.5, frame.channel[1] = -2.0, frame.channel[2] = 0.25;
              vigil_datagram(&frame, bytes);
              return fwrite(bytes, sizeof bytes, 1, stdout) != 1;
            }"""
        for compiler, standard, suffix in [("cc", "c11", ".c"), ("c++", "c++17", ".cpp")]:
            with self.subTest(compiler), tempfile.TemporaryDirectory() as folder:
                file = pathlib.Path(folder) / f"main{suffix}"
                file.write_text(source)
                program = pathlib.Path(folder) / "main"
                flags = [f"-std={standard}", "-Wall", "-Wextra", "-Werror", f"-I{EXAMPLES}"]
                subprocess.run([compiler, *flags, file, "-o", program], check=True)
                made = subprocess.run([program], check=True, capture_output=True).stdout
                self.assertEqual(made, vigil_types.datagram(frame))

    def test_the_header_and_python_take_the_same_verdicts(self):
        source = """
            #include "vigil_types.h"
            #include <stdio.h>
            int main(void) {
              uint8_t bytes[VIGIL_VERDICT_DATAGRAM_SIZE + 1];
              vigil_verdict verdict;
              size_t count = fread(bytes, 1, sizeof bytes, stdin);
              if (!vigil_take_verdict(bytes, count, &verdict)) return 1;
              return printf("%s %.2f", verdict.mode_name, verdict.speed_scale) < 0;
            }"""
        verdict = vigil_types.Verdict(mode_name=b"LF_STUCK", speed_scale=0.25)
        good = datagram_of(verdict)
        corrupt = good[:-1] + bytes([good[-1] ^ 1])
        frame = vigil_types.datagram(vigil_types.SensorFrame())
        with tempfile.TemporaryDirectory() as folder:
            file, program = pathlib.Path(folder) / "main.c", pathlib.Path(folder) / "main"
            file.write_text(source)
            flags = ["-std=c11", "-Wall", "-Wextra", "-Werror", f"-I{EXAMPLES}"]
            subprocess.run(["cc", *flags, file, "-o", program], check=True)
            for data, is_one in [(good, True), (corrupt, False), (good[:-1], False), (frame, False)]:
                done = subprocess.run([program], input=data, capture_output=True)
                self.assertEqual(done.returncode, 0 if is_one else 1)
                self.assertEqual(vigil_types.verdict_of(data) is not None, is_one)
                if is_one:
                    self.assertEqual(done.stdout, b"LF_STUCK 0.25")

    def test_the_checksum_is_castagnolis(self):
        # The check value of the catalogue of parametrised CRC algorithms.
        self.assertEqual(vigil_types.crc32c(b"123456789"), 0xE3069283)


if __name__ == "__main__":
    unittest.main()
