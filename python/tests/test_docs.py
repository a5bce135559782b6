"""The Python in the documents runs, and prints what its comments say."""

import contextlib
import io
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

REPOSITORY = Path(os.environ.get("KD_REPOSITORY", Path(__file__).parents[2]))
DOCUMENTS = ["docs/python.md", "docs/clusters.md", "README.md", "python/README.md"]


@pytest.mark.parametrize("name", DOCUMENTS)
def test_blocks_run(name):
    if name in ("docs/python.md", "README.md"):
        pytest.importorskip("trimesh")
    if name == "docs/clusters.md":
        pytest.importorskip("dask.array")
    text = (REPOSITORY / name).read_text()
    blocks = re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    assert blocks
    # In a process of its own: `install` lasts.
    program = "\n".join(blocks)
    found = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120)
    assert found.returncode == 0, found.stderr
    lines = [line for line in program.splitlines() if "print(" in line and "  # " in line and "..." not in line]
    printed = found.stdout.splitlines()
    for line in lines:
        assert line.split("  # ")[-1] in printed, (line, printed)


def test_docstrings_run():
    import doctest

    import kd

    with contextlib.redirect_stdout(io.StringIO()):
        assert doctest.testmod(kd).attempted >= 3
    assert doctest.testmod(kd).failed == 0
