"""FCLIB: the exchange format of frictional contact problems (HDF5), read and written.

Local form u = W r + q; global form M v = H r + G lambda + f, u = H^T v + w, G^T v + b = 0; normal first.
Matrices are triplets (nz >= 0), compressed columns (nz = -1) or rows (nz = -2). Source: Acary, Bremond,
Dubois, Heyn, Koziara: FCLIB, a collection of discrete 3D frictional contact problems (2014).

The problem of a step is also kept as assembled, in a group `rungwise` beside these; reading prefers it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from rungwise.contact.prepare.equivalent import in_contacts
from rungwise.contact.problem import Array, Matrix, Problem, numbers, sized, vector
from rungwise.contact.step.problem import ContactProblem
from rungwise.keywords import keywords

_CSR = -2
_STEP = "rungwise"
_MOST = 2.0**53


def h5py_library(field: str = "file") -> Any:
    """The optional h5py; ValueError naming `field` and the package to install when h5py is missing."""
    try:
        import h5py
    except ImportError:
        raise ValueError(f"{field}: HDF5 needs h5py; pip install 'rungwise[fclib]'") from None
    return h5py


def read_fclib(path: Path) -> Problem | ContactProblem:
    """The problem in `path`; ValueError naming the part that is missing or wrong."""
    try:
        with h5py_library().File(path, "r") as file:
            if _STEP in file:
                return _read_step(_group(file, _STEP))
            if "fclib_local" in file:
                return _read_local(_group(file, "fclib_local"))
            if "fclib_global" in file:
                return _read_global(_group(file, "fclib_global"))
    except (KeyError, OSError, RuntimeError) as error:
        raise ValueError(f"file: cannot be read ({' '.join(str(error).split())})") from None
    raise ValueError("file: holds neither fclib_local nor fclib_global")


def _group(parent: Any, name: str) -> Any:
    group = parent.get(name)
    if group is None or not hasattr(group, "keys"):
        raise ValueError(f"{name}: is missing, or not a group")
    return group


def _array(group: Any, name: str) -> Array:
    """The numbers of a data set; ValueError naming it when it is missing or holds something else."""
    item = group.get(name)
    if item is None or not hasattr(item, "dtype"):
        raise ValueError(f"{name}: is missing, or not a data set")
    try:
        return numbers(name, item[()])
    except MemoryError:
        raise ValueError(f"{name}: is larger than memory") from None


def _wholes(group: Any, name: str) -> NDArray[np.int64]:
    values = _array(group, name)
    if not (np.isfinite(values).all() and (np.abs(values) < _MOST).all() and (values % 1.0 == 0.0).all()):
        raise ValueError(f"{name}: must be whole numbers")
    return values.astype(np.int64)


def _whole(group: Any, name: str) -> int:
    values = _wholes(group, name).ravel()
    if len(values) != 1:
        raise ValueError(f"{name}: must be one whole number, not {len(values)}")
    return int(values[0])


def _directions(group: Any) -> int:
    d = _whole(group, "spacedim")
    if d not in (2, 3):
        raise ValueError(f"spacedim: must be 2 or 3, not {d}")
    return d


def _read_step(group: Any) -> ContactProblem:
    made = {name: np.ascontiguousarray(_array(group, name)) for name in ContactProblem.__annotations__}
    k, b, d = len(np.atleast_1d(made["mu"])), len(np.atleast_1d(made["F"])), made["R"].shape[-1:]
    for name, shape in (("R", (k, *d, *d)), ("R_s", (b,)), ("mu", (k,)), ("F", (b,)), ("quantum", (1,))):
        if made[name].shape != shape or len(d) != 1:
            raise ValueError(f"{name}: has shape {made[name].shape}; the other fields make it {shape}")
    step = ContactProblem(**made)
    Problem.of_step(step)
    return step


def _read_local(group: Any) -> Problem:
    """Equality rows (V, R, s) become free unknowns: W r + V x + q = u, V^T r + R x + s = 0."""
    vectors, d = _group(group, "vectors"), _directions(group)
    q, mu = vector("q", _array(vectors, "q")), _array(vectors, "mu")
    W = _read_matrix(group, "W", (len(q), len(q)))
    local = Problem.local(W, q, mu, d)
    if "R" not in group and "V" not in group:
        return local
    s = vector("s", _array(vectors, "s"))
    V, R = _read_matrix(group, "V", (len(q), len(s))), _read_matrix(group, "R", (len(s), len(s)))
    free = np.full(len(s), np.inf)
    A = sp.block_array([[W, V], [V.T, R]], format="csr")
    return Problem(A, np.concatenate([local.b, s]), mu, d, -free, free)


def _read_global(group: Any) -> Problem:
    vectors, d = _group(group, "vectors"), _directions(group)
    f, w, mu = (vector(name, _array(vectors, name)) for name in ("f", "w", "mu"))
    M, H = _read_matrix(group, "M", (len(f), len(f))), _read_matrix(group, "H", (len(f), len(w)))
    joints: dict[str, Any] = {}
    if "G" in group:
        b = vector("b", _array(vectors, "b"))
        joints = {"S": _read_matrix(group, "G", (len(f), len(b))).T, "w_s": b}
    return Problem.balance(M, f, H.T, w, mu, directions=d, **joints)


def _read_matrix(parent: Any, name: str, shape: tuple[int, int]) -> sp.csr_array:
    group = _group(parent, name)
    try:
        m, n, nz = (_whole(group, part) for part in ("m", "n", "nz"))
    except ValueError as error:
        raise ValueError(f"{name}: not a sparse matrix ({error})") from None
    if (m, n) != shape:
        raise ValueError(f"{name}: has shape {(m, n)}; the other fields make it {shape}")
    try:
        p, i, x = _wholes(group, "p"), _wholes(group, "i"), _array(group, "x")
        if nz > min(len(p), len(i), len(x)):
            raise ValueError(f"nz is {nz}, and there are {min(len(p), len(i), len(x))} entries")
        if nz >= 0:
            made = sp.csr_array((x[:nz], (i[:nz], p[:nz])), shape=(m, n))
        else:
            used = int(p[-1])
            form = sp.csr_array if nz == _CSR else sp.csc_array
            compressed = form((x[:used], i[:used], p), shape=(m, n))
            compressed.check_format(full_check=True)
            made = sp.csr_array(compressed)
    except (ValueError, IndexError, TypeError, MemoryError) as error:
        raise ValueError(f"{name}: not a sparse matrix ({' '.join(str(error).split())})") from None
    return made


@keywords
def write_fclib(
    path: str | Path,
    problem: Problem | ContactProblem,
    r: Array | None = None,
    title: str = "rungwise",
    description: str = "",
    math_info: str = "",
) -> None:
    """Write `problem`, in local form if it has contacts alone, else in global form, with forces r (k d,) of
    its contacts as a guess, to the file `path`; with its `title`, `description` and `math_info`.

    Compliance and limited forces, for which FCLIB has no words, are written as equivalent contacts and
    velocities (see `equivalent`), after the problem's own; the guess is zero there. The file appears whole or
    not at all.

    Raises ValueError for one direction, for unknowns with limits to one side, and for an r that is no force
    of the contacts; OSError.
    """
    path, step = Path(path), problem if isinstance(problem, ContactProblem) else None
    problem = Problem.of(problem)
    if problem.directions == 1 and len(problem.mu):
        raise ValueError("directions: FCLIB holds contacts in the plane and in space only")
    guess = None if r is None else vector("r", r)
    if guess is not None:
        sized("r", guess, problem.rows)
    if np.isfinite(problem.upper).any() or _yields(problem):
        problem = in_contacts(problem)
    parts = _local_parts(problem) if len(problem.lower) == 0 else _global_parts(problem)
    form, matrices, vectors = parts
    h5py = h5py_library()
    partial = path.with_name(path.name + ".part")
    try:
        with h5py.File(partial, "w") as file:
            group = file.create_group(form)
            group["spacedim"] = np.array([max(problem.directions, 2)], np.int32)
            for name, matrix in matrices.items():
                _write_matrix(group.create_group(name), matrix)
            for name, values in {**vectors, "mu": problem.mu}.items():
                group[f"vectors/{name}"] = values
            for name, text in (("title", title), ("description", description), ("math_info", math_info)):
                group[f"info/{name}"] = text
            for name in ContactProblem.__annotations__ if step is not None else ():
                file[f"{_STEP}/{name}"] = getattr(step, name)
            if guess is not None:
                file["guesses/number_of_guesses"] = np.array([1], np.int32)
                file["guesses/1/r"] = np.pad(guess, (0, problem.rows - len(guess)))
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def _yields(problem: Problem) -> bool:
    """Whether contacts or joints beside velocities are compliant."""
    rows, n = problem.rows, problem.velocities
    A = sp.csr_array(problem.A)
    return n > 0 and any(abs(A[own, own]).sum() > 0.0 for own in (slice(0, rows), slice(rows + n, None)))


_Parts = tuple[str, dict[str, Matrix], dict[str, Array]]


def _local_parts(problem: Problem) -> _Parts:
    return "fclib_local", {"W": problem.A}, {"q": problem.b}


def _global_parts(problem: Problem) -> _Parts:
    """M, H and G of a problem whose other unknowns are velocities and joints."""
    rows, n = problem.rows, problem.velocities
    A, b = sp.csr_array(problem.A), problem.b
    contact, speed, joint = slice(0, rows), slice(rows, rows + n), slice(rows + n, None)
    if np.isfinite(problem.lower).any() or np.isfinite(problem.upper).any():
        raise ValueError("lower: FCLIB has no words for limited unknowns")
    H, G = A[contact, speed].T, A[joint, speed].T
    own = (A[contact, contact], A[contact, joint], A[joint, contact], A[joint, joint])
    apart = (A[speed, contact] + H, A[speed, joint] + G)
    if any(abs(part).sum() > 0.0 for part in (*own, *apart)):
        raise ValueError("A: FCLIB's global form has no compliance, and forces act where rates are read")
    matrices = {"M": A[speed, speed], "H": H}
    vectors = {"f": -b[speed], "w": b[contact]}
    if rows + n < len(b):
        matrices["G"], vectors["b"] = G, b[joint]
    return "fclib_global", matrices, vectors


def _write_matrix(group: Any, matrix: Matrix) -> None:
    """Write the matrix as triplets."""
    entries = sp.coo_array(matrix)
    row, column = entries.coords
    for name, value in (
        ("m", matrix.shape[0]), ("n", matrix.shape[1]), ("nz", entries.nnz), ("nzmax", entries.nnz),
    ):  # fmt: skip
        group[name] = np.array([value], np.int32)
    group["p"], group["i"], group["x"] = column.astype(np.int32), row.astype(np.int32), entries.data
