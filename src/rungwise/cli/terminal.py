"""Output of commands, and their refusals."""

from __future__ import annotations

import os
import signal
import socket
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn, Protocol

from rungwise.errors import InputError

BAD_INPUT = 2
INTERRUPTED = 130


class Answer(Protocol):
    """What commands find: a text, and plain values."""

    def summary(self) -> dict[str, object]: ...


def refuse(message: str) -> NoReturn:
    """One line on the standard error, with --json an object on the standard output, too; exit code 2."""
    line = " ".join(message.split())
    if "--json" in sys.argv:
        show_json({"error": line})
    print(f"rungwise: {line}", file=sys.stderr)
    sys.exit(BAD_INPUT)


def note(message: str) -> None:
    """One line on the standard error beside an answer."""
    print(f"rungwise: {message}", file=sys.stderr)


def show(text: str) -> None:
    """Print; a reader who leaves early ends the program quietly, a full disk with one line."""
    try:
        print(text.encode(sys.stdout.encoding, "replace").decode(sys.stdout.encoding), flush=True)
    except OSError as error:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if isinstance(error, BrokenPipeError):
            sys.exit(1)
        refuse(f"output: cannot be written ({error.strerror or error})")


def show_json(value: object, indent: int | None = None) -> None:
    from rungwise.plain import json_text

    show(json_text(value, indent))


@contextmanager
def plain_errors() -> Iterator[None]:
    """Wrong input of any kind becomes one line."""
    try:
        yield
    except InputError as error:
        refuse(str(error))


@contextmanager
def writable_to(out: Path | None, more: str = "") -> Iterator[None]:
    """What cannot be written to `out` becomes one line; `more` follows."""
    try:
        yield
    except OSError as error:
        refuse(f"out: {out} cannot be written ({error.strerror or error}){more}")


@contextmanager
def heard_at_once() -> Iterator[None]:
    """Within the context Ctrl-C ends compiled loops, too, which Python itself waits for.

    It waits for a kernel that is being loaded: in the middle of its work a compiler may lose an interrupt."""
    heard, told = socket.socketpair()
    told.setblocking(False)
    watcher = threading.Thread(target=_watch, args=(heard,), daemon=True)
    watcher.start()
    before = signal.set_wakeup_fd(told.fileno(), warn_on_full_buffer=False)
    handler = signal.getsignal(signal.SIGINT)
    if handler is signal.default_int_handler:
        signal.signal(signal.SIGINT, _interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
        signal.set_wakeup_fd(before)
        told.close()
        watcher.join()
        heard.close()


def _interrupt(_signal: int, frame: FrameType | None) -> None:
    """Raise the interrupt, or leave that to the call of a kernel within which something is being loaded."""
    calls: Any = sys.modules.get("rungwise.compilation.calls")
    call = getattr(calls, "call", None)  # None while the module itself is being loaded
    above = None if frame is None else frame.f_back
    while call is not None and above is not None:
        if above.f_code is call.__code__:
            calls.thread.error = KeyboardInterrupt()
            return
        above = above.f_back
    raise KeyboardInterrupt


def _watch(heard: socket.socket) -> None:
    """End compiled loops at each interrupt, which comes as a byte, until nobody tells any more."""
    while received := heard.recv(1):
        deadline = sys.modules.get("rungwise.deadline")
        if received[0] == signal.SIGINT and deadline is not None:
            deadline.end_all()


@contextmanager
def stoppable(kept: str) -> Iterator[None]:
    """Ctrl-C ends the command with one line that says what is kept."""
    try:
        yield
    except KeyboardInterrupt:
        print(f"rungwise: stopped; {kept}", file=sys.stderr)
        sys.exit(INTERRUPTED)


def answer(found: Answer, as_json: bool) -> None:
    """Print what a command found."""
    show_json(found.summary()) if as_json else show(str(found))
