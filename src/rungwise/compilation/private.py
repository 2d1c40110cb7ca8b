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


def made(folder: Path) -> tuple[Path, str]:
    """A folder that only the user may enter, made where it is missing, and without links in its path; and why
    it is not to be used, in words, empty if it may be."""
    try:
        place = folder.expanduser().absolute()
        missing = [each for each in (place, *place.parents) if not each.exists()]
        why = open_to_others(missing[-1].parent, above=True) if missing else ""
        for each in [] if why else reversed(missing):
            with suppress(FileExistsError):
                each.mkdir(mode=0o700)
        if not why:
            place = place.resolve(strict=True)
            why = open_to_others(place)
        if not why:
            with tempfile.TemporaryFile(dir=place):
                pass
    except OSError as error:
        return folder, f"{folder} cannot be written ({error.strerror})"
    except RuntimeError:  # a path of links that lead to one another, before Python 3.13
        return folder, f"{folder} is a link that leads nowhere"
    return place, why


def open_to_others(folder: Path, *, above: bool = False) -> str:
    """Who else may change what is in a folder, or, if it is `above` one, replace that; in words, empty if
    nobody may. Raises OSError, and RuntimeError for links that lead to one another."""
    if not hasattr(os, "getuid"):
        return ""
    whole, user = folder.resolve(strict=True), os.getuid()
    for each in (whole, *whole.parents):
        status, is_above = each.stat(), above or each != whole
        if status.st_uid != user and not (is_above and status.st_uid == 0):
            return f"{each} belongs to another user"
        if _is_writable(status, user) and not (is_above and status.st_mode & stat.S_ISVTX):
            return f"others may write to {each} (remove it; or chmod go-w, if nobody has put anything there)"
    return ""


def is_own(status: os.stat_result) -> bool:
    """Whether a file belongs to the user, or to root, and nobody else may write to it."""
    if not hasattr(os, "getuid"):
        return True
    user = os.getuid()
    return status.st_uid in (user, 0) and not _is_writable(status, user)


def _is_writable(status: os.stat_result, user: int) -> bool:
    """Whether others than the user may write."""
    by_group = status.st_mode & stat.S_IWGRP and not _is_alone(status.st_gid, user)
    return bool(by_group or status.st_mode & stat.S_IWOTH)


@cache
def _is_alone(group: int, user: int) -> bool:
    """Whether a group is the user's own, as many systems give one to each: it has the user's name, and no
    other members."""
    import grp
    import pwd

    try:
        name, own = pwd.getpwuid(user).pw_name, grp.getgrgid(group)
    except KeyError:
        return False
    members = {*own.gr_mem, *(each.pw_name for each in pwd.getpwall() if each.pw_gid == group)}
    return own.gr_name == name and members <= {name}


@cache
def of_process() -> Path:
    """A new folder that is removed when the process ends; one that is not there, where nothing can be kept
    from others."""
    for parent in dict.fromkeys((tempfile.gettempdir(), "/tmp", "/var/tmp")):
        with suppress(OSError):
            folder = Path(tempfile.mkdtemp(prefix="rungwise-", dir=parent)).resolve()
            if not open_to_others(folder):
                atexit.register(shutil.rmtree, folder, ignore_errors=True)
                return folder
            folder.rmdir()
    return Path(os.devnull) / "nowhere"
