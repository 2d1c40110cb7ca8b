"""Arguments that benchmarks share."""

from __future__ import annotations

import argparse
from collections.abc import Sequence


def wants_json(arguments: Sequence[str] | None, description: str) -> bool:
    """Whether one JSON object is asked for, of a benchmark that has no other option."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    return bool(parser.parse_args(arguments).json)
