"""`rungwise solve`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rungwise.cli.arguments import ForceOption, JsonOption, LimitOption, numeric, unused
from rungwise.cli.terminal import refuse, show, show_json


def solve(
    file: Annotated[Path, typer.Argument(help="FCLIB HDF5, text of Siconos' numerics, or ContactBench npz.")],
    tol: Annotated[float, numeric("--tol", "Residual to reach; it has no unit.")] = 1e-9,
    kind: Annotated[
        str | None,
        typer.Option(
            "--kind", help="Kind of a text file: lcp, mlcp, relay, local, global; from its name if not given."
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="npz file for r (normal first) and u = W r + q.")
    ] = None,
    force: ForceOption = False,
    limit: LimitOption = None,
    as_json: JsonOption = False,
) -> int:
    """Solve a contact problem from a file, and judge the answer.

    Example: rungwise solve problem.hdf5 --out answer.npz"""
    from rungwise.contact.files import read_problem
    from rungwise.contact.solution import Status
    from rungwise.contact.solve import solve as solve_problem

    unused(out, force)
    try:
        solution = solve_problem(read_problem(file, kind), tol=tol, limit=limit)
    except ValueError as error:
        refuse(str(error))
    if out is not None:
        try:
            solution.save(out)
        except OSError as error:
            refuse(f"out: {out} cannot be written ({error.strerror or error})")
        except ValueError:
            refuse(f"out: {str(out)!r} does not name a file")
    summary = solution.summary()
    if as_json:
        show_json({"file": str(file), **summary})
    else:
        show(
            f"{file.name}: {solution.status}\n"
            f"  {summary['reason']}\n"
            f"  {summary['unknowns']} unknowns, {summary['contacts']} contacts;"
            f" residual {solution.residuals.worst:.1e},"
            f" {solution.iterations} iterations of {', '.join(solution.chain) or 'none'}"
        )
    return 0 if solution.status is Status.SOLVED else 1
