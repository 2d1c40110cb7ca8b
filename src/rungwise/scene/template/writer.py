"""The records of a scene while they are written: literals in place, programs for the others, and bounds."""

from __future__ import annotations

import numpy as np

from rungwise.scene.errors import MAY_BE_INFINITE, STRICT, SceneError, out_of_range
from rungwise.scene.fields.fields import Drive, Force, Servo, Speed
from rungwise.scene.fields.values import Number
from rungwise.scene.language.expression import STACK, Code, Programs, evaluate
from rungwise.scene.language.names import Names
from rungwise.scene.template import records as rec
from rungwise.scene.template.template import Bounds, Checks

INF = float("inf")


class Writer:
    """Records, `counts` of each kind, and the programs and checks that remain for binding."""

    def __init__(self, counts: tuple[int, ...], names: Names, inputs: tuple[str, ...]) -> None:
        self.counts, self.names = counts, names
        self._inputs = {names.parameters.index(name): name for name in inputs}
        self.buffer = rec.allocate(counts)
        self.records = rec.views(self.buffer, counts)
        self.static: list[tuple[Code, int]] = []
        self.timed: list[tuple[Code, int]] = []
        self.speeds: list[tuple[Code, int]] = []
        self.reads_time = False
        self.readers: dict[str, list[str]] = {name: [] for name in inputs}
        self._checks: list[tuple[int, float, float, int, str]] = []

    @property
    def checks(self) -> Checks:
        """The bounds of all numbers written."""
        slots, low, high, kinds, paths = zip(*self._checks, strict=True)
        bounds = Bounds(
            slots=np.array(slots, np.int64), low=np.array(low), high=np.array(high),
            kinds=np.array(kinds, np.int64),
        )  # fmt: skip
        return Checks(bounds, paths)

    def put(
        self,
        kind: str,
        index: int,
        field: str,
        value: Number,
        path: str,
        *,
        above: float | None = None,
        at_least: float = -INF,
        at_most: float = INF,
        infinite: bool = False,
        timed: bool = False,
    ) -> None:
        """Store a literal, or keep the program that computes the number; and keep its bounds."""
        target = rec.slot(self.counts, kind, index, field)
        constant = None if isinstance(value, str) else float(value)
        if isinstance(value, str):
            code = self.names.number(value, path, timed)
            self.static.append((code, target))
            if not code.reads:
                constant = _constant(code)
            read = [name for slot, name in self._inputs.items() if slot in code.reads]
            reads_time = len(self.names.parameters) in code.reads
            if timed and (read or reads_time):
                (self.speeds if field == "drive_speed" else self.timed).append((code, target))
                self.reads_time |= reads_time
                for name in read:
                    if path not in self.readers[name]:
                        self.readers[name].append(path)
            elif read and ".drive." in path:
                needs = " without a target" if path.endswith("target_speed") else ""
                raise SceneError(f"{path}: cannot follow the input {read[0]}{needs}")
        else:
            self.buffer[target] = value
        low = at_least if above is None else above
        kinds = (STRICT if above is not None else 0) | (MAY_BE_INFINITE if infinite else 0)
        self._checks.append((target, low, at_most, kinds, path))
        wrong = None if constant is None else out_of_range(constant, low, at_most, kinds)
        if wrong is not None:
            raise SceneError(f"{path}: {wrong}")

    def drive(self, kind: str, index: int, drive: Drive | None, path: str) -> None:
        """Write the drive of a coordinate (kind `coordinates`) or of a joint's coordinate (`measures`)."""
        record = getattr(self.records, kind)[index]

        def put(field: str, value: Number, source: str, at_least: float = -INF, timed: bool = False) -> None:
            self.put(
                kind, index, field, value, f"{path}.{source}",
                at_least=at_least, timed=timed, infinite=field == "limit",
            )  # fmt: skip

        match drive:
            case Speed(speed=speed):
                record["drive"] = rec.SPEED
                put("drive_speed", speed, "speed", timed=True)
            case Servo():
                record["drive"] = rec.SERVO
                record["has_target"] = drive.target is not None
                put("stiffness", drive.stiffness, "stiffness", 0.0)
                put("drive_damping", drive.damping, "damping", 0.0)
                put("limit", drive.limit, "limit", 0.0)
                put("target_speed", drive.target_speed, "target_speed", timed=drive.target is not None)
                if drive.target is not None:
                    put("target", drive.target, "target", timed=True)
            case Force(force=force):
                record["drive"] = rec.FORCE
                put("force", force, "force", timed=True)


def _constant(code: Code) -> float:
    """The value of a program that reads nothing."""
    programs = Programs([code])
    start, stop = programs.table[0].tolist()
    return float(evaluate(programs.code, programs.constants, start, stop, np.zeros(0), np.zeros(STACK)))
