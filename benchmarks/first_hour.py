"""What a newcomer types and waits for until a first result and a first picture, here and elsewhere.

    python benchmarks/first_hour.py [--json]

Commands are counted from the first `pip install` on, lines are those of code that is not shipped with the
tool. Seconds are wall time of a fresh process with everything installed; for rungwise with an empty cache of
kernels, and again with what that left there. Tools that are not installed are left out; so are pictures
that need what the machine lacks, such as OpenGL for MuJoCo's. The tasks are of each tool's own kind: a
grasp here, a ball dropped on a floor, an arm's tip sent to a place, a quadratic program.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict, dataclass
from importlib.util import find_spec

RENDER = """
import matplotlib.image
renderer = mujoco.Renderer(model)
renderer.update_scene(data)
matplotlib.image.imsave("first.png", renderer.render())
"""
BALL = """
import mujoco
model = mujoco.MjModel.from_xml_string('''
<mujoco><worldbody>
  <light pos="0 0 3"/>
  <geom type="plane" size="1 1 0.1"/>
  <body pos="0 0 1"><freejoint/><geom size="0.1" mass="1"/></body>
</worldbody></mujoco>''')
data = mujoco.MjData(model)
while data.time < 1.0:
    mujoco.mj_step(model, data)
print(data.qpos)
"""
ARM = """
import mink
import mujoco
import numpy as np
model = mujoco.MjModel.from_xml_string('''
<mujoco><worldbody><body>
  <joint axis="0 0 1"/><geom type="capsule" fromto="0 0 0 1 0 0" size="0.05"/>
  <body pos="1 0 0">
    <joint axis="0 0 1"/><geom type="capsule" fromto="0 0 0 1 0 0" size="0.05"/>
    <site name="tip" pos="1 0 0"/>
  </body>
</body></worldbody></mujoco>''')
configuration = mink.Configuration(model)
configuration.update([0.1, 0.2])
task = mink.FrameTask("tip", "site", position_cost=1.0, orientation_cost=0.0)
task.set_target(mink.SE3.from_translation(np.array([1.0, 1.0, 0.0])))
for _ in range(200):
    velocity = mink.solve_ik(configuration, [task], 0.05, "quadprog")
    configuration.integrate_inplace(velocity, 0.05)
print(configuration.q)
"""
PROGRAM = """
import numpy as np
from qpsolvers import solve_qp
P, q = np.diag([2.0, 1.0]), np.array([-1.0, 1.0])
G, h = np.array([[1.0, 1.0]]), np.array([0.5])
print(solve_qp(P, q, G, h, solver="quadprog"))
"""
SIM = ("-m", "rungwise", "sim", "two_finger", "--model", "dynamic-rigid")
VIEW = ("-m", "rungwise", "view", "two_finger", "--model", "dynamic-rigid")


@dataclass(frozen=True)
class Tool:
    """How to a first result and a first picture: arguments of python, or code; None where there is none."""

    name: str
    module: str
    result: tuple[str, ...] | str
    picture: tuple[str, ...] | str | None


TOOLS = (
    Tool("rungwise", "rungwise", SIM, VIEW),
    Tool("MuJoCo", "mujoco", BALL, BALL + RENDER),
    Tool("mink", "mink", ARM, ARM + "data = configuration.data\n" + RENDER),
    Tool("qpsolvers", "qpsolvers", PROGRAM, None),
)


@dataclass(frozen=True)
class Row:
    """Commands, lines of code, and seconds at the first and at the second time; None where it failed."""

    tool: str
    what: str
    commands: int
    lines: int
    first: float | None
    again: float | None


def rows() -> list[Row]:
    found = []
    for tool in TOOLS:
        if find_spec(tool.module) is None:
            continue
        with tempfile.TemporaryDirectory() as folder:
            for what, job in (("result", tool.result), ("picture", tool.picture)):
                if job is not None:
                    found.append(measured(tool, what, job, folder))
    return found


def measured(tool: Tool, what: str, job: tuple[str, ...] | str, folder: str) -> Row:
    code = job if isinstance(job, str) else ""
    arguments = ("-c", code) if code else tuple(job)
    environment = os.environ | {"RUNGWISE_CACHE": os.path.join(folder, what)}
    seconds: list[float | None] = []
    for _ in range(2):
        began = time.perf_counter()
        ended = subprocess.run([sys.executable, *arguments], cwd=folder, env=environment, capture_output=True)
        seconds.append(time.perf_counter() - began if ended.returncode == 0 else None)
    lines = sum(1 for line in code.splitlines() if line.strip())
    return Row(tool.name, what, 2, lines, *seconds)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--json", action="store_true")
    asked, found = parser.parse_args(), rows()
    if asked.json:
        print(json.dumps([asdict(row) for row in found]))
        return
    print(f"{'tool':10} {'first':8} {'commands':>8} {'lines':>5} {'seconds':>8} {'again':>7}")
    for row in found:
        first, again = (f"{s:.1f}" if s is not None else "-" for s in (row.first, row.again))
        print(f"{row.tool:10} {row.what:8} {row.commands:8} {row.lines:5} {first:>8} {again:>7}")


if __name__ == "__main__":
    main()
