"""Folders that nobody but the user may change: what is kept there is run as code.

The rule is that of sshd for keys (StrictModes): the user owns the folder; it, and every folder above it,
belongs to the user or to root, and nobody else may write to it. Folders above may be open to all where only
owners may remove what is in them, as in the folder of temporary files.
"""

from __future__ import annotations

import atexit
import os
import shutil
import stat
import tempfile
from contextlib import suppress
from functools import cache
from pathlib import Path


def made(folder: Path) -> str:
    """Make a folder that only the user may enter, where it is missing; returns why it is not to be used, in
    words, empty if it may be."""
    try:
        for missing in reversed([each for each in (folder, *folder.parents) if not each.exists()]):
            with suppress(FileExistsError):
                missing.mkdir(mode=0o700)
        why = open_to_others(folder)
        if not why:
            with tempfile.TemporaryFile(dir=folder):
                pass
    except OSError as error:
        return f"{folder} cannot be written ({error.strerror})"
    return why


def open_to_others(folder: Path) -> str:
    """Who else may change what is in a folder, in words; empty if nobody may. Raises OSError."""
    if not hasattr(os, "getuid"):
        return ""
    whole, user = folder.resolve(strict=True), os.getuid()
    for each in (whole, *whole.parents):
        status = each.stat()
        if status.st_uid != user and (each == whole or status.st_uid != 0):
            return f"{each} belongs to another user"
        keeps = each != whole and bool(status.st_mode & stat.S_ISVTX)
        by_group = status.st_mode & stat.S_IWGRP and not _is_alone(status.st_gid, user)
        if not keeps and (by_group or status.st_mode & stat.S_IWOTH):
            return f"others may write to {each} (chmod go-w mends it)"
    return ""


@cache
def _is_alone(group: int, user: int) -> bool:
    """Whether a group has no other members than a user: many systems give each user such a group."""
    import grp
    import pwd

    try:
        own = {pwd.getpwuid(user).pw_name}
        members = set(grp.getgrgid(group).gr_mem)
    except KeyError:
        return False
    return members | {each.pw_name for each in pwd.getpwall() if each.pw_gid == group} <= own


@cache
def of_process() -> Path:
    """A new folder that is removed when the process ends."""
    folder = Path(tempfile.mkdtemp(prefix="rungwise-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder
