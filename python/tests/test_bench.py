"""The benchmark runs in a small form, and kd has no wrong answer in it."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

REPOSITORY = Path(os.environ.get("KD_REPOSITORY", Path(__file__).parents[2]))


def test_small_form(tmp_path):
    pytest.importorskip("trimesh")
    out = tmp_path / "lines.jsonl"
    program = [sys.executable, str(REPOSITORY / "python/bench/compare.py")]
    small = ["--rays", "2000", "--judged", "400", "--repeats", "1", "--out", str(out)]
    found = subprocess.run(program + small, capture_output=True, text=True, timeout=300)
    assert found.returncode == 0, found.stderr
    lines = [json.loads(line) for line in out.read_text().splitlines()]
    judged = [line for line in lines if line["kind"] == "wrong" and line["engine"] == "kd, trimesh"]
    assert len(judged) >= 9 and all(line["hit"] == line["count"] == 0 for line in judged)
    assert all(line["rays"] > 300 for line in judged)
    assert {line["query"] for line in lines if line["kind"] == "speed"} >= {"random, all hits", "inside"}
    assert "| random, first hit |" in found.stdout and "## Wrong answers" in found.stdout
