"""Arguments that benchmarks share."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path


def of_tasks(description: str, folder: Path, seeds: int, limit: float) -> argparse.ArgumentParser:
    """The arguments of benchmarks that plan the tasks of a folder from several seeds, each within a limit."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--folder", type=Path, default=folder)
    parser.add_argument("--seeds", type=int, default=seeds)
    parser.add_argument("--limit", type=float, default=limit)
    parser.add_argument("--tasks", default="", help="beginnings of their names, with commas between")
    return parser


def wants_json(arguments: Sequence[str] | None, description: str) -> bool:
    """Whether one JSON object is asked for, of a benchmark that has no other option."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    return bool(parser.parse_args(arguments).json)
