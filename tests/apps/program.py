"""Runs the program in a scratch folder."""
import os
import pathlib
import resource
import subprocess
import tempfile
import unittest

PROGRAM = os.environ["TREEMARCH"]


def in_memory(folder):
    """Whether the files of a folder lie in memory."""
    done = subprocess.run(["stat", "-f", "-c", "%T", folder], capture_output=True, text=True, check=True)
    return done.stdout.strip() in ("tmpfs", "ramfs")


class ProgramTest(unittest.TestCase):
    def setUp(self):
        scratch = tempfile.TemporaryDirectory()
        self.addCleanup(scratch.cleanup)
        self.dir = pathlib.Path(scratch.name)

    def path(self, name):
        return str(self.dir / name)

    def files(self):
        return {str(p.relative_to(self.dir)) for p in self.dir.rglob("*")}

    def run_program(self, *arguments, file_size_limit=None):
        limit = None
        if file_size_limit is not None:
            limit = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (file_size_limit, file_size_limit))
        # Python ignores the signal that goes with the limit, and so shall the program: writing fails instead.
        return subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, stdin=subprocess.DEVNULL,
                              preexec_fn=limit, restore_signals=False, timeout=250)

    def succeed(self, *arguments):
        done = self.run_program(*arguments)
        self.assertEqual(done.returncode, 0, f"{arguments}: {done.stderr}")
        return done.stdout

    def fail_with(self, code, *arguments, says="", file_size_limit=None):
        """Exit code, one line on stderr, nothing on stdout and nothing written."""
        before = self.files()
        done = self.run_program(*arguments, file_size_limit=file_size_limit)
        lines = [l for l in done.stderr.splitlines() if not l.startswith("treemarch: warning: ")]
        self.assertEqual(done.returncode, code, f"{arguments}: {done.stderr}")
        self.assertEqual(len(lines), 1, f"{arguments}: {done.stderr}")
        self.assertTrue(lines[0].startswith("treemarch: error: "), lines[0])
        self.assertIn(says, lines[0])
        self.assertEqual(done.stdout, "")
        self.assertEqual(self.files(), before, arguments)
