"""CoACD in a process of its own (see `decompose`): a mesh on the standard input, its pieces on the standard
output, both as arrays of numbers."""

from __future__ import annotations

import io
import os
import sys

import numpy as np


def main() -> None:
    """Decompose the mesh on the standard input."""
    answer = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # the library prints what it does
    import coacd

    with np.load(io.BytesIO(sys.stdin.buffer.read()), allow_pickle=False) as given:
        mesh = coacd.Mesh(given["vertices"], given["faces"].astype(np.int32))
        accuracy, remesh = float(given["accuracy"][0]), bool(given["remesh"][0])
    coacd.set_log_level("off")
    found = coacd.run_coacd(mesh, threshold=accuracy, preprocess_mode="on" if remesh else "off")
    pieces = {f"piece{k}": np.asarray(corners, float) for k, (corners, _) in enumerate(found)}
    np.savez(answer, **pieces)  # type: ignore[arg-type]
    answer.close()


if __name__ == "__main__":
    main()
