"""Contact problems on disk, both ways."""

from rungwise.contact.files.fclib import h5py_library, write_fclib
from rungwise.contact.files.read import read_problem

__all__ = [
    "h5py_library", "read_problem", "write_fclib",
]  # fmt: skip
