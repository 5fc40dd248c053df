"""The interpreter that has the other programs."""

import os
import subprocess

from tests.conftest import PEERS_PYTHON, ROOT


def run_peers(*arguments):
    """Run the peers' interpreter in the project's folder; return the process, which must succeed."""
    where = {"cwd": ROOT, "env": {**os.environ, "PYTHONPATH": str(ROOT)}}
    command = [str(PEERS_PYTHON), *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300, **where)
    assert done.returncode == 0, done.stderr
    return done
