"""All public names, and where each is defined: read by type checkers, by editors, and at run time."""

from .contact.analysis import (
    Closure,
    Kind,
    Piece,
    Sensitivity,
    Solutions,
    extreme_motions,
    force_closure,
    form_closure,
    sensitivity,
    solutions,
)
from .contact.files import read_problem, write_fclib
from .contact.problem import Problem
from .contact.solution import ContactSolution, Status
from .contact.solve import solve
from .deadline import LimitError
from .errors import InputError
from .fitting.explain import Explanation, explain
from .fitting.fit import fit
from .fitting.found import Fit, Residual
from .fitting.measured.errors import MotionError
from .fitting.measured.motions import Motions
from .fitting.predict import FitError
from .hierarchy.compare import compare
from .hierarchy.comparison import Comparison
from .hierarchy.counterexample import Counterexample, load_counterexample
from .keywords import KeywordError
from .models.ladder import (
    DYNAMIC_COMPLIANT,
    DYNAMIC_RIGID,
    GEOMETRIC,
    KINEMATIC,
    LADDER,
    QUASISTATIC_COMPLIANT,
    QUASISTATIC_RIGID,
    Rung,
)
from .outcome import OUTCOMES, Code, Outcome
from .planning.design.design import Design, design
from .planning.diagnosis.diagnose import Diagnosis, diagnose
from .planning.execution.policy import Policy
from .planning.execution.verify import Verification, verify
from .planning.lift.lift import plan
from .planning.lift.stages import StageError
from .planning.motion.budget import Stage
from .planning.motion.free_paths import PlannerMissing
from .planning.plan import Plan, PlanError, load_plan
from .planning.squeeze import SqueezeFunction, SqueezePlan, squeeze_plan
from .planning.task.task import instances
from .scene import InvalidScene, Scene, SceneBuilder, SceneError, parts, schema, shipped
from .scene.read import load
from .scene.space import SpaceScene
from .scene.space.read import shipped_in_space
from .scene.worlds import add_world
from .sets.cells.labels import Label
from .sets.doomed.doomed import DoomedSet, doomed_set, load_doomed_set
from .sets.feasible.difference import Between, between
from .sets.feasible.feasible import FeasibleSet, feasible_set, load_set
from .sets.feasible.solution_sets import SolutionSets, solution_sets
from .sets.store import SetError
from .simulation.derivatives.chain import RunSensitivity, run_sensitivity
from .simulation.derivatives.sensitivity import StepSensitivity, step_sensitivity
from .simulation.inputs import Schedule, ScheduleError, Segment
from .simulation.live.observation import Contacts, Observation, ObservationError
from .simulation.options import ModelError, RunOptions
from .simulation.result import Run
from .simulation.rows import States
from .simulation.spatial.replay import Replay, ReplayError, replay
from .simulation.spatial.result import SpaceRun
from .simulation.state import State, StateError, load_state
from .simulation.touching import Touching, touching
from .viewing.inline import PictureError, plot, to_html
from .viewing.plane.parting import draw_parting
from .viewing.space.film import FilmError
from .viewing.view import view
from .viewing.write import ViewError
from .world.batch import Batch, Results
from .world.carriers import TaskError
from .world.export.mjcf import mjcf
from .world.export.trajectory import JointTrajectory
from .world.margins import Answers, Geometry, ask, geometry
from .world.parts import ExportError
from .world.planar.rollouts import Rollouts
from .world.rollout import rollout
from .world.run import load_run, simulate
from .world.spatial.rollouts import SpaceRollouts
from .world.stepped import Simulation

__all__ = [
    "DYNAMIC_COMPLIANT",
    "DYNAMIC_RIGID",
    "GEOMETRIC",
    "KINEMATIC",
    "LADDER",
    "OUTCOMES",
    "QUASISTATIC_COMPLIANT",
    "QUASISTATIC_RIGID",
    "Answers",
    "Batch",
    "Between",
    "Closure",
    "Code",
    "Comparison",
    "ContactSolution",
    "Contacts",
    "Counterexample",
    "Design",
    "Diagnosis",
    "DoomedSet",
    "Explanation",
    "ExportError",
    "FeasibleSet",
    "FilmError",
    "Fit",
    "FitError",
    "Geometry",
    "InputError",
    "InvalidScene",
    "JointTrajectory",
    "KeywordError",
    "Kind",
    "Label",
    "LimitError",
    "ModelError",
    "MotionError",
    "Motions",
    "Observation",
    "ObservationError",
    "Outcome",
    "PictureError",
    "Piece",
    "Plan",
    "PlanError",
    "PlannerMissing",
    "Policy",
    "Problem",
    "Replay",
    "ReplayError",
    "Residual",
    "Results",
    "Rollouts",
    "Run",
    "RunOptions",
    "RunSensitivity",
    "Rung",
    "Scene",
    "SceneBuilder",
    "SceneError",
    "Schedule",
    "ScheduleError",
    "Segment",
    "Sensitivity",
    "SetError",
    "Simulation",
    "SolutionSets",
    "Solutions",
    "SpaceRollouts",
    "SpaceRun",
    "SpaceScene",
    "SqueezeFunction",
    "SqueezePlan",
    "Stage",
    "StageError",
    "State",
    "StateError",
    "States",
    "Status",
    "StepSensitivity",
    "TaskError",
    "Touching",
    "Verification",
    "ViewError",
    "add_world",
    "ask",
    "between",
    "compare",
    "design",
    "diagnose",
    "doomed_set",
    "draw_parting",
    "explain",
    "extreme_motions",
    "feasible_set",
    "fit",
    "force_closure",
    "form_closure",
    "geometry",
    "instances",
    "load",
    "load_counterexample",
    "load_doomed_set",
    "load_plan",
    "load_run",
    "load_set",
    "load_state",
    "mjcf",
    "parts",
    "plan",
    "plot",
    "read_problem",
    "replay",
    "rollout",
    "run_sensitivity",
    "schema",
    "sensitivity",
    "shipped",
    "shipped_in_space",
    "simulate",
    "solution_sets",
    "solutions",
    "solve",
    "squeeze_plan",
    "step_sensitivity",
    "to_html",
    "touching",
    "verify",
    "view",
    "write_fclib",
]
__version__: str
