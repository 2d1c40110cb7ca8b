"""Pages of the documentation as their readers use them: commands, files, Python, and what they print."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parent.parent
_BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?", re.IGNORECASE)
_WAITED = re.compile(r"worst residual \S+, \S+ s\b")


@dataclass(frozen=True)
class Block:
    """A block of code of a page, with the text that it prints, if the page says."""

    language: str
    code: str
    printed: str | None

    @property
    def file(self) -> str | None:
        """Name of the file that the reader is told to write: the comment in the first line."""
        named = re.match(r"# (\S+\.yaml)\n", self.code)
        return named[1] if self.language == "yaml" and named else None


def blocks(page: Path) -> list[Block]:
    """The blocks of a page; one of text is what the block before it prints."""
    found: list[Block] = []
    for language, code in _BLOCK.findall(page.read_text("utf-8")):
        if language == "text":
            found[-1] = Block(found[-1].language, found[-1].code, code)
        else:
            found.append(Block(language, code, None))
    return found


def same(said: str, printed: str) -> bool:
    """Whether two outputs are equal: words to the letter, numbers to four digits; times of waiting and
    residuals vary."""
    said, printed = (_WAITED.sub("", text).strip() for text in (said, printed))
    if _NUMBER.sub("#", said) != _NUMBER.sub("#", printed):
        return False
    pairs = zip(_NUMBER.findall(said), _NUMBER.findall(printed), strict=True)
    return all(math.isclose(float(a), float(b), rel_tol=2e-4, abs_tol=2e-9) for a, b in pairs)
