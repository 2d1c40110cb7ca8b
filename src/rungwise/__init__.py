"""Plan manipulation with contact models of every fidelity: one scene, six models, one equation.

import rungwise as rw
scene = rw.load("two_finger")
for model in rw.LADDER[1:]:
    run = rw.simulate(scene, model, parameters={"v2": 0.9})
    print(model.name, run.outcome, run.worst_residual)
"""

from rungwise.contact.analysis.all_solutions import extreme_motions, solutions
from rungwise.contact.analysis.closure import Closure, force_closure, form_closure
from rungwise.contact.analysis.pieces import Kind, Piece, Solutions
from rungwise.contact.analysis.sensitivity import Sensitivity, sensitivity
from rungwise.contact.files.fclib import write_fclib
from rungwise.contact.files.read import read_problem
from rungwise.contact.problem import Problem
from rungwise.contact.solution import ContactSolution, Status
from rungwise.contact.solve import solve
from rungwise.models.ladder import (
    DYNAMIC_COMPLIANT,
    DYNAMIC_RIGID,
    GEOMETRIC,
    KINEMATIC,
    LADDER,
    QUASISTATIC_COMPLIANT,
    QUASISTATIC_RIGID,
    Rung,
)  # fmt: skip
from rungwise.outcome import OUTCOMES, Code, Outcome
from rungwise.scene import InvalidScene, Scene, SceneError, load, schema, shipped
from rungwise.sets.between import Between, between
from rungwise.sets.doomed import DoomedSet, doomed_set, load_doomed_set
from rungwise.sets.feasible import FeasibleSet, feasible_set, load_set
from rungwise.sets.labels import Label
from rungwise.sets.solution_sets import SolutionSets, solution_sets
from rungwise.sets.store import SetError
from rungwise.simulation.batch import Batch, Results
from rungwise.simulation.chain import RunSensitivity, run_sensitivity
from rungwise.simulation.options import ModelError
from rungwise.simulation.result import Run
from rungwise.simulation.run import Simulation, simulate
from rungwise.simulation.sensitivity import StepSensitivity, step_sensitivity
from rungwise.simulation.touching import Touching, touching
from rungwise.simulation.trajectory import load as load_run
from rungwise.viewing.view import ViewError, view

__all__ = [
    "DYNAMIC_COMPLIANT", "DYNAMIC_RIGID", "GEOMETRIC", "KINEMATIC", "LADDER", "OUTCOMES",
    "QUASISTATIC_COMPLIANT", "QUASISTATIC_RIGID", "Batch", "Between", "Closure", "Code", "ContactSolution",
    "DoomedSet", "FeasibleSet", "InvalidScene", "Kind", "Label", "ModelError", "Outcome", "Piece",
    "Problem", "Results", "Run", "RunSensitivity", "Rung", "Scene", "SceneError", "Sensitivity", "SetError",
    "Simulation", "SolutionSets", "Solutions", "Status", "StepSensitivity", "Touching", "ViewError",
    "between", "doomed_set", "extreme_motions", "feasible_set", "force_closure", "form_closure", "load",
    "load_doomed_set", "load_run", "load_set", "read_problem", "run_sensitivity", "schema", "sensitivity",
    "shipped", "simulate", "solution_sets", "solutions", "solve", "step_sensitivity", "touching", "view",
    "write_fclib",
]  # fmt: skip
__version__ = "0.1.0"
