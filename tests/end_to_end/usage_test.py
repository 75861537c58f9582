#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The command line explains itself and refuses what it does not know. usage_test.py EVPOSE"""
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

EVPOSE = None


def run(*words):
    return subprocess.run([EVPOSE, *words], capture_output=True, text=True, timeout=30, stdin=subprocess.DEVNULL)


class UsageTest(unittest.TestCase):
    def test_help_names_every_command_and_each_has_its_own(self):
        text = run("--help").stdout
        commands = re.findall(r"^  ([a-z]+)  ", text.split("Subcommands:")[1], re.MULTILINE)
        self.assertLessEqual({"demo", "track", "eval"}, set(commands))
        for command in commands:
            with self.subTest(command=command):
                result = run(command, "--help")
                self.assertEqual(result.returncode, 0)
                self.assertIn("--help", result.stdout)

    def test_version_is_three_numbers(self):
        for flag in ("--version", "-V"):
            self.assertRegex(run(flag).stdout, r"^evpose \d+\.\d+\.\d+\n$")

    def test_wrong_usage_is_status_2_and_one_line(self):
        for words in ([], ["trakc"], ["track"], ["track", "--no-such-option"], ["eval", "one"],
                      ["eval", "a.tum", "b.tum", "--align", "sideways"]):
            with self.subTest(words=words):
                result = run(*words)
                self.assertEqual(result.returncode, 2)
                self.assertEqual(result.stderr.count("\n"), 1, result.stderr)
                self.assertTrue(result.stderr.startswith("evpose: "), result.stderr)

    def test_a_slip_gets_the_nearest_word(self):
        for words, nearest in ((["trakc"], "track"), (["-q", "mapp"], "map"), (["map", "biuld", "a.ply"], "build"),
                               (["track", "a", "--mpa", "b"], "--map"), (["track", "a", "--init_sigma=1,2"], "--init-sigma"),
                               (["chekc", "a", "--map", "b"], "check"), (["bench", "unsen"], "unseen")):
            with self.subTest(words=words):
                result = run(*words)
                self.assertEqual(result.returncode, 2)
                self.assertRegex(result.stderr, rf"^evpose: .*: is no (command|option) of evpose.*; did you mean '{nearest}'\?.*\n$")
        for words in (["frobnicate"], ["track", "a", "--quux"]):
            with self.subTest(words=words):
                self.assertRegex(run(*words).stderr, r"^evpose: .*: is no (command|option) of evpose.*; see evpose.*--help\n$")

    def test_the_man_page_and_the_completion_hold_what_the_help_does(self):
        with tempfile.TemporaryDirectory() as folder:
            man, bash = (pathlib.Path(folder) / name for name in ("evpose.1", "evpose.bash"))
            self.assertEqual(run("manual", "--man", man, "--bash", bash).returncode, 0)
            page = man.read_text().replace("\\-", "-")
            for command in (["track"], ["map", "build"], ["mavlink", "check"]):
                self.assertIn(f".SS evpose {' '.join(command)}\n", page)
                for option in re.findall(r"^  (?:-\w,)?(--[a-z-]+)", run(*command, "--help").stdout, re.MULTILINE):
                    self.assertIn(option, page)
                    self.assertIn(option, self.completed(bash, *command, option[:-1]))
            if shutil.which("groff"):
                told = subprocess.run(["groff", "-man", "-ww", "-Tutf8", man], capture_output=True, text=True, timeout=60)
                self.assertEqual((told.returncode, told.stderr), (0, ""))
            self.assertEqual(self.completed(bash, "tra"), ["track"])
            self.assertEqual(self.completed(bash, "-q", "map", "bu"), ["build"])
            self.assertEqual(self.completed(bash, "track", "fligh"), [], "files are the shell's own")

    def completed(self, bash, *words):
        script = 'source "$1"; shift; COMP_WORDS=(evpose "$@"); COMP_CWORD=$#; _evpose; printf "%s\\n" "${COMPREPLY[@]}"'
        done = subprocess.run(["bash", "-uc", script, "-", str(bash), *words], capture_output=True, text=True, timeout=60)
        self.assertEqual(done.stderr, "")
        return done.stdout.split()


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    EVPOSE = sys.argv.pop(1)
    unittest.main()
