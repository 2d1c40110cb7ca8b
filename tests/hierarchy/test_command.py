"""`rungwise compare`: text, JSON, exit codes."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from rungwise import cli


def run(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> int:
    monkeypatch.setattr(sys, "argv", ["rungwise", "compare", *arguments])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    return int(ended.value.code or 0)


STUCK = ("--set", "mu=2", "--set", "v2=0.6")
FEW = ("--samples", "0", "--model", "kinematic")


@pytest.mark.long
def test_text_json_and_counterexamples(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert run(monkeypatch, "two_finger", *FEW) == 0
    assert "quasistatic-rigid     kinematic             Def. 1" in capsys.readouterr().out
    assert run(monkeypatch, "two_finger", *STUCK, *FEW, "--json", "--out", str(tmp_path)) == 1
    found = json.loads(capsys.readouterr().out)
    assert not found["ok"] and found["pairs"][0]["verdict"] == "fails"
    assert found["counterexamples"][0]["simpler"]["model"] == "kinematic"
    file = str(tmp_path / "counterexample-1.json")
    assert run(monkeypatch, file) == 0
    assert "kinematic at epsilon 0: " in capsys.readouterr().out
    assert run(monkeypatch, file, "--json") == 0
    again = json.loads(capsys.readouterr().out)
    assert again["ok"] and again["saved"] == found["counterexamples"][0]["distance"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("nowhere",), "scene: 'nowhere' is no file"),
        (("two_finger", "--model", "kinetic"), "did you mean kinematic?"),
        (("two_finger", "--accuracy", "7"), "accuracy: must be a number in 1e-6..1"),
        (("two_finger", "--set", "v3=1"), "unknown 'v3'"),
    ],
)
def test_wrong_input(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: tuple[str, ...],
    words: str,
) -> None:
    assert run(monkeypatch, *arguments) == 2
    told = capsys.readouterr().err
    assert words in told and told.count("\n") == 1
