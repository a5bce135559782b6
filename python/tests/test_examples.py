"""The examples run, small."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

REPOSITORY = Path(os.environ.get("KD_REPOSITORY", Path(__file__).parents[2]))


def test_sight_of_a_city(tmp_path):
    for needed in ("distributed", "dask.array", "PIL"):
        pytest.importorskip(needed)
    program = REPOSITORY / "python/examples/sight_of_a_city.py"
    found = subprocess.run(
        [sys.executable, program, "--side", "8"], cwd=tmp_path, capture_output=True, text=True, timeout=180
    )
    assert found.returncode == 0, found.stderr
    assert "64 places, 368640 rays, 2 workers" in found.stdout
    assert (tmp_path / "sight_of_a_city.png").stat().st_size > 100
