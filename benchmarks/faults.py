"""Deliberate faults for `mutants.py`: signs, factors, indices and thresholds in central files."""

from __future__ import annotations

from typing import NamedTuple


class Fault(NamedTuple):
    """A text that is in a file once, what it is replaced by, the nearest tests, and in a line what is wrong
    then; `plain`: the tests run without compilation."""

    name: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]
    wrong: str
    plain: bool = False


_ARM = "tests/simulation/core/test_arm.py"
_CORE = (_ARM, "tests/simulation/core/test_particle.py")
_SOLVE = "tests/contact/test_solve.py::test_"
_CERTIFICATES = (
    "tests/contact/test_certificate.py",
    f"{_SOLVE}squeezed_between_two_walls_is_jammed_with_proof",
    f"{_SOLVE}walls_that_part_are_no_jam_though_forces_that_pull_would_prove_it",
    f"{_SOLVE}the_heaviest_body_on_the_lightest_is_never_said_to_jam",
)
_RESIDUALS = (
    "tests/contact/test_residual.py",
    f"{_SOLVE}penetration_is_how_fast_a_gap_closes_beyond_contact",
    f"{_SOLVE}penetration_is_not_solved_however_great_friction_is",
    f"{_SOLVE}fast_contacts_hide_nothing_of_slow_ones_that_they_do_not_touch",
)
_WITNESS = ("tests/sets/test_feasible.py::test_a_witness_replays_and_a_certificate_bounds_the_error",)
_LAWS = "tests/simulation/test_contact_laws.py::test_"
_UNITS = ("tests/scene/test_dimensions.py",)
_HANDS = ("tests/planning/modes/test_hand_numbers.py",)
_LIMITS = "tests/test_every_limit.py::test_"

FAULTS = (
    # Verdicts and acceptance: what counts as solved, proved, reached.
    Fault(
        "certificate-reach-zero", "src/rungwise/contact/judge/certificate.py",
        "REACH = 1e3", "REACH = 0.0", _CERTIFICATES, "a certificate of a step needs no margin",
    ),
    Fault(
        "farkas-reach-zero", "src/rungwise/contact/judge/farkas.py",
        "REACH = 1e6", "REACH = 0.0", _CERTIFICATES, "Farkas margins of zero",
    ),
    Fault(
        "farkas-sign-free", "src/rungwise/contact/judge/farkas.py",
        "if (p < least).any() or (p > most).any() or (headings", "if (p > most).any() or (headings",
        _CERTIFICATES, "multipliers of a proof may have the wrong sign",
    ),
    Fault(
        "certificate-sign-free", "src/rungwise/contact/judge/certificate.py",
        "if force.shape != offset.shape or (force[:contacts] < 0.0).any():",
        "if force.shape != offset.shape:", _CERTIFICATES, "a kinematic certificate may pull at contacts",
    ),
    Fault(
        "certificate-drives-unlimited", "src/rungwise/contact/judge/certificate.py",
        "-problem.F[~joints] * np.abs(rates[~joints])", "-0.5 * problem.F[~joints] * np.abs(rates[~joints])",
        _CERTIFICATES, "drives resist with half their limit in a proof of missing support",
    ),
    Fault(
        "judge-penetration-sign", "src/rungwise/contact/judge/residuals.py",
        "found[2] = max(found[2], -y[n])", "found[2] = max(found[2], y[n])", _RESIDUALS,
        "the judge tells opening as penetration",
    ),
    Fault(
        "judge-own-weight", "src/rungwise/contact/judge/residuals.py",
        "OWN = 0.03", "OWN = 0.0", ("tests/contact/test_solve.py",),
        "violations beside a row's own terms do not count",
    ),
    Fault(
        "laws-without-contacts", "src/rungwise/contact/judge/laws.py",
        "        total += out[k] * out[k]\n    for j", "    for j", _RESIDUALS,
        "violations of contacts do not count in the norm",
    ),
    Fault(
        "cone-half-disc", "src/rungwise/contact/kinds/cone.py",
        "length, radius, total = 0.0, law[0] * max(x[0], 0.0), 0.0",
        "length, radius, total = 0.0, 0.5 * law[0] * max(x[0], 0.0), 0.0",
        ("tests/contact/test_spatial.py",), "the judge of groups knows half the friction",
    ),
    Fault(
        "residual-of-rows-half-cone", "src/rungwise/contact/solver/residual.py",
        "law[0] = p.mu[k]", "law[0] = 0.5 * p.mu[k]",
        ("tests/contact/test_residual.py",), "the disc of friction has half its radius",
    ),
    Fault(
        "limit-reached-one-way", "src/rungwise/contact/solver/residual.py",
        "law[0], law[1], a[0], is_free = -p.F[m], p.F[m],",
        "law[0], law[1], a[0], is_free = -p.F[m], math.inf,",
        ("tests/contact/test_residual.py",), "a drive has no limit in one direction",
    ),
    Fault(
        "contact-work-at-end", "src/rungwise/simulation/core/update_state.py",
        "lever = 0.5 * (state.v[i] + end)", "lever = end", _CORE,
        "work is force times the speed at the end of the step", True,
    ),
    Fault(
        "theta-velocity-sign", "src/rungwise/simulation/core/update_state.py",
        "return v_new if prescribed else (v_new - (1.0 - theta) * v_old) / theta",
        "return v_new if prescribed else (v_new + (1.0 - theta) * v_old) / theta", _CORE,
        "the end of a step under theta extrapolates to the wrong side", True,
    ),
    Fault(
        "date-after-condition", "src/rungwise/simulation/watched/verdicts.py",
        "return before if found else 1.0", "return after if found else 1.0",
        ("tests/simulation/test_conditions.py", "tests/simulation/test_two_finger.py"),
        "a step is cut after a condition began to hold, instead of before",
    ),
    Fault(
        "force-greatest-of-three", "src/rungwise/simulation/planar/state/verdicts.py",
        "state.pushes[c] = min(push, state.recent[0, c], state.recent[1, c])",
        "state.pushes[c] = max(push, state.recent[0, c], state.recent[1, c])",
        ("tests/simulation/test_conditions.py",), "an impulse counts as a force",
    ),
    Fault(
        "sunk-in-core", "src/rungwise/simulation/core/tolerances.py",
        "SINKING = 0.1", "SINKING = 1.0", _CORE,
        "contacts yield ten times as far before the compliant model fails", True,
    ),
    Fault(
        "jam-without-proof", "src/rungwise/simulation/stepping/stepper.py",
        "self.outcome = Code.NOT_CONVERGED if self.certificate is None else outcome",
        "self.outcome = outcome", _CORE,
        "a step that is not solved is a jam without a proof", True,
    ),
    # Assembly: the step's equations.
    Fault(
        "fall-without-2", "src/rungwise/models/assemble.py",
        "math.sqrt(2.0 * abs(loaded) * terms.low[0])", "math.sqrt(abs(loaded) * terms.low[0])", _CORE,
        "sqrt(2 a h) without the 2", True,
    ),
    Fault(
        "joints-close-slowly", "src/rungwise/models/assemble.py",
        "(max(h, 0.5 * ease) if drifts else h)", "(max(h, ease) if drifts else h)", _CORE,
        "rigid joints close in a pause instead of half of one", True,
    ),
    Fault(
        "overlap-comes-apart-fast", "src/rungwise/models/assemble.py",
        "problem.w[k * d] = terms.gap[k] / max(h, ease)", "problem.w[k * d] = terms.gap[k] / h", _CORE,
        "overlap comes apart in a step, however short", True,
    ),
    Fault(
        "restitution-early", "src/rungwise/models/assemble.py",
        "terms.gap[k] + h * g <= 0.0", "terms.gap[k] + 2.0 * h * g <= 0.0", _CORE,
        "bodies bounce a step before they touch", True,
    ),
    Fault(
        "damper-sign", "src/rungwise/models/assemble.py",
        "(stiff * terms.error[r, 0] + damp * terms.error[r, 1])",
        "(stiff * terms.error[r, 0] - damp * terms.error[r, 1])", _CORE,
        "a servo follows the opposite of the speed that it is asked for", True,
    ),
    Fault(
        "theta-stiffness-sign", "src/rungwise/models/assemble.py",
        "kept += problem.R[k, i, j] * (damp - (1.0 - theta) * h * stiff)",
        "kept += problem.R[k, i, j] * (damp + (1.0 - theta) * h * stiff)", _CORE,
        "the elastic force at the start of a step has the wrong sign under theta", True,
    ),
    Fault(
        "shear-sign", "src/rungwise/models/assemble.py",
        "if i == 0 else -yielded", "if i == 0 else yielded", _CORE,
        "a contact that is sheared goes on in the direction of its shear", True,
    ),
    Fault(
        "driven-resistance-sign", "src/rungwise/models/assemble.py",
        "problem.c[i] -= resist * speed[b]", "problem.c[i] += resist * speed[b]", _CORE,
        "inertia couples free coordinates to driven ones with the wrong sign", True,
    ),
    Fault(
        "relaxation-theta", "src/rungwise/models/assemble.py",
        "early = (1.0 - theta) * h if pushed else 0.0", "early = (1.0 - theta) * h", _CORE,
        "a deformation without force relaxes by theta", True,
    ),
    Fault(
        "step-gap-sign", "src/rungwise/simulation/stepping/attempt.py",
        "terms.gap[k] -= h * rate(", "terms.gap[k] += h * rate(", _CORE,
        "the gap's advance with the wrong sign in the attempt", True,
    ),
    Fault(
        "step-half-error", "src/rungwise/simulation/stepping/advance.py",
        "return 0.5 * change, 0.5 * h", "return 0.25 * change, 0.5 * h", _CORE,
        "half of a controlled step's error", True,
    ),
    Fault(
        "limit-inertia", "src/rungwise/models/limit.py",
        "LIMIT = 1e-8", "LIMIT = 1e-4", _CORE,
        "the limit without inertia keeps ten thousand times as much of it", True,
    ),
    Fault(
        "unbalanced-share", "src/rungwise/simulation/core/step.py",
        "_UNBALANCED = 1e-4", "_UNBALANCED = 1e-1", _CORE,
        "inertia may carry a tenth of the load where there is none", True,
    ),
    # Steps of controlled length.
    Fault(
        "controlled-half-error", "src/rungwise/simulation/planar/step/error_control.py",
        "error = disagreement(records, rung, control, 0.5 * h, workspace)",
        "error = 0.5 * disagreement(records, rung, control, 0.5 * h, workspace)",
        ("tests/simulation/test_order.py::test_controlled_steps_are_as_long_as_their_error_allows",),
        "half of a controlled step's error in the plane",
    ),
    # Planning.
    Fault(
        "tree-farthest-node", "src/rungwise/planning/search/tree.py",
        "away.argmin(axis=1)", "away.argmax(axis=1)", ("tests/planning/test_choices.py",),
        "a tree's nearest node is the farthest",
    ),
    Fault(
        "tree-worst-move", "src/rungwise/planning/search/tree.py",
        'ranks = np.argsort(tree.lack[children], kind="stable")',
        'ranks = np.argsort(-tree.lack[children], kind="stable")', ("tests/planning/test_choices.py",),
        "a tree varies its worst moves",
    ),
    Fault(
        "confirmed-at-own-error", "src/rungwise/planning/lift/lift.py",
        "run = plan.replay(tol=TENTH * plan.tol", "run = plan.replay(tol=plan.tol",
        ("tests/planning/test_choices.py",), "a replay is confirmed at its own error instead of a tenth",
    ),
    Fault(
        "elites-longest-first", "src/rungwise/planning/search/shooting.py",
        "np.where(trials.reached > 0, trials.reached, 10**6))",
        "np.where(trials.reached > 0, -trials.reached, 10**6))", ("tests/planning/test_choices.py",),
        "of plans that reach the goal the longest counts as best",
    ),
    Fault(
        "periodic-long-way", "src/rungwise/planning/search/shooting.py",
        "np.mod(plain + 0.5, 1.0) - 0.5", "np.mod(plain, 1.0)", ("tests/planning/test_choices.py",),
        "angles differ by the long way round",
    ),
    Fault(
        "reserve-not", "src/rungwise/planning/task/reserve.py",
        "ast.UnaryOp(ast.Not(), _tightened(inner, -part))", "ast.UnaryOp(ast.Not(), _tightened(inner, part))",
        ("tests/planning/test_plan.py::test_goals_are_tightened",),
        "a goal with `not` is widened by the reserve",
    ),
    Fault(
        "bound-two-sided", "src/rungwise/planning/execution/verify.py",
        "beta.ppf(1.0 - CONFIDENCE, successes", "beta.ppf(0.5 * (1.0 - CONFIDENCE), successes",
        ("tests/planning/test_verify.py",), "the one-sided bound of a rate is two-sided",
    ),
    Fault(
        "worst-are-best", "src/rungwise/planning/execution/verify.py",
        "order = failed[np.argsort(np.nan_to_num(margin[failed], nan=-np.inf)",
        "order = failed[np.argsort(-np.nan_to_num(margin[failed], nan=-np.inf)",
        ("tests/planning/test_verify.py",), "the samples that are told as worst nearly succeed",
    ),
    Fault(
        "stops-lack-most", "src/rungwise/planning/motion/early_stops.py",
        'order = np.argsort(own, kind="stable")', 'order = np.argsort(-own, kind="stable")',
        ("tests/planning/test_choices.py",), "a push is cut short where most is lacking",
    ),
    Fault(
        "pushes-wrong-frame", "src/rungwise/planning/search/push_effects.py",
        "np.stack([c * way[:, 0] + s * way[:, 1], c * way[:, 1] - s * way[:, 0], way[:, 2]], axis=1)",
        "np.stack([c * way[:, 0] - s * way[:, 1], c * way[:, 1] + s * way[:, 0], way[:, 2]], axis=1)",
        ("tests/planning/test_choices.py",), "what a push did is remembered in a frame turned the other way",
    ),
    # Sets.
    Fault(
        "witness-farthest", "src/rungwise/sets/feasible/feasible.py",
        "corners[int(np.argmin(distance))]", "corners[int(np.argmax(np.where(good, distance, -1.0)))]",
        _WITNESS, "a goal's witness is the farthest corner",
    ),
    Fault(
        "certified-below", "src/rungwise/sets/feasible/feasible.py",
        "betaincinv(count + 1, n - count, 1.0 - delta)", "betaincinv(count + 1, n - count, delta)",
        _WITNESS, "the rate of wrong labels is bounded from below",
    ),
    Fault(
        "certified-unended", "src/rungwise/sets/feasible/feasible.py",
        "wrong = (self.labels(points) != truth) | is_open", "wrong = self.labels(points) != truth",
        (f"{_LIMITS}runs_that_a_limit_ends_count_as_wrong_whatever_the_set_says",),
        "runs that a limit ended count as right",
    ),
    Fault(
        "unended-kept", "src/rungwise/sets/feasible/oracle.py",
        "done = len(rows) - int((outcome == Code.RUNNING).sum())", "done = len(rows)",
        ("tests/sets/test_kept.py::test_of_a_batch_that_a_limit_ends_the_runs_that_are_done_are_kept",),
        "batches that a limit ended count as done",
    ),
    Fault(
        "unended-doomed", "src/rungwise/sets/doomed/cell_mapping.py",
        "if (outcome == Code.RUNNING).any():", "if (outcome == Code.INVALID).all():",
        (f"{_LIMITS}a_call_without_time_says_so[doomed_set]",), "macro-steps that a limit ended count",
    ),
    Fault(
        "compared-in-part", "src/rungwise/hierarchy/comparison.py",
        "return not self.unfinished and all(", "return all(",
        (f"{_LIMITS}a_comparison_keeps_what_is_measured",), "what is not measured bears the table out",
    ),
    Fault(
        "nearest-corner-other", "src/rungwise/sets/feasible/feasible.py",
        "(inside >= 0.5).astype(np.int64)", "(inside < 0.5).astype(np.int64)",
        ("tests/sets/test_export.py::test_where_three_labels_meet_points_have_the_label_of_the_nearest_corner",),
        "a point has the label of the opposite corner",
    ),
    Fault(
        "margins-blind", "src/rungwise/sets/cells/tree.py",
        "np.abs(margins).min(axis=1) < 0.5 * spread", "np.abs(margins).min(axis=1) < 0.0 * spread",
        ("tests/sets/test_tree.py",), "no cell is split for its margins",
    ),
    Fault(
        "crossing-mirrored", "src/rungwise/sets/cells/crossings.py",
        "root = a + (b - a) * at_a / (at_a - at_b)", "root = b - (b - a) * at_a / (at_a - at_b)",
        ("tests/sets/test_tree.py",), "the boundary is interpolated from the wrong end",
    ),
    Fault(
        "difference-swapped", "src/rungwise/sets/feasible/difference.py",
        "lost=float(np.mean(a & ~b))", "lost=float(np.mean(b & ~a))",
        ("tests/sets/test_feasible.py", "tests/hierarchy/test_compare.py"),
        "what a richer rung loses is what it gains",
    ),
    Fault(
        "backward-short-box", "src/rungwise/sets/doomed/backward.py",
        "(last[c, u, k] + 1 if upper == 1 else first[c, u, k])",
        "(last[c, u, k] if upper == 1 else first[c, u, k])",
        ("tests/sets/test_doomed.py::test_around_and_backward",), "a box of cells lacks its last cell", True,
    ),
    Fault(
        "images-least", "src/rungwise/sets/doomed/cell_mapping.py",
        "self._about(moved, greatest=True), *self._travel.T)",
        "self._about(moved, greatest=False), *self._travel.T)", ("tests/sets/test_doomed.py",),
        "images of cells are as narrow as their least motion",
    ),
    Fault(
        "margin-of-other-motion", "src/rungwise/sets/motions.py",
        "np.fmin(margin, other.margin) if wanted", "np.fmax(margin, other.margin) if wanted",
        ("tests/sets/test_solution_sets.py",), "a guaranteed point has the margin of its best motion",
    ),
    # Derivatives.
    Fault(
        "sensitivity-theta-sign", "src/rungwise/simulation/derivatives/sensitivity.py",
        "(turn - (1.0 - held.theta) * directions.get", "(turn + (1.0 - held.theta) * directions.get",
        ("tests/simulation/test_sensitivity.py",), "the sensitivity's sign under theta",
    ),
    Fault(
        "turn-of-derivative", "src/rungwise/simulation/derivatives/steps.py",
        "(by_q @ dq + h * (by_speed @ dspeed)) / (2.0 * TURN)",
        "(by_speed @ dq + h * (by_speed @ dspeed)) / (2.0 * TURN)",
        ("tests/simulation/spatial/test_step_sensitivity.py",),
        "turns at the start are not seen from the axes at the end",
    ),
    Fault(
        "patch-bend", "src/rungwise/system/spatial/patch/ascent.py",
        "return ee + p + u, ef + q + v, ff + r + w", "return ee + p, ef + q, ff + r",
        ("tests/system/spatial/test_patch.py",), "the second geom's curvature is left out of Newton's method",
    ),
    Fault(
        "patch-deepest", "src/rungwise/system/spatial/patch/clip.py",
        "    _admit(deepest, chosen, size, patch)\n", "",
        ("tests/system/spatial/test_patch.py",), "the deepest of more than four places may be left out",
    ),
    Fault(
        "patch-unproved", "src/rungwise/system/spatial/patch/pairs.py",
        "not (_least(shared, patch) <= s + GAIN * size and s > -DEEP * size)", "not s > -DEEP * size",
        ("tests/system/spatial/test_patch.py",), "the first guess of a normal is taken without proof",
    ),
    Fault(
        "patch-deep-unproved", "src/rungwise/system/spatial/patch/pairs.py",
        "<= s + GAIN * size and s > -DEEP * size)", "<= s + GAIN * size)",
        ("tests/system/spatial/test_patch.py",), "a deep overlap takes the first normal unsearched",
    ),
    Fault(
        "patch-round-axes", "src/rungwise/system/spatial/patch/normal.py",
        "if kind not in (SPHERE, MESH):", "if kind == BOX:",
        ("tests/system/spatial/test_patch.py",), "round geoms with one middle part along a long way",
    ),
    Fault(
        "patch-rims", "src/rungwise/system/spatial/patch/clip.py",
        "if abs(found) <= LEVEL:\n", "if True:\n",
        ("tests/system/spatial/test_patch.py",), "rims that cross are met only roughly",
    ),
    Fault(
        "field-beside", "src/rungwise/system/spatial/patch/fields.py",
        "count = _sift(g, prism, before, count, wide, long, shapes, fields, frames, found)", "pass",
        ("tests/simulation/spatial/test_held.py",), "edges between the triangles of a height field are bumps",
    ),
    Fault(
        "gap-of-derivative", "src/rungwise/simulation/derivatives/steps.py",
        '        terms.gap[:k] = held.terms["gap"]\n', "",
        ("tests/simulation/spatial/test_step_sensitivity.py",), "gaps are differenced twice",
    ),
    Fault(
        "deformation-theta", "src/rungwise/simulation/derivatives/sensitivity.py",
        'push += np.einsum("ijm,j->im", dC - early * dK, delta)',
        'push += np.einsum("ijm,j->im", dC + early * dK, delta)', ("tests/simulation/test_sensitivity.py",),
        "a deformation's derivative by stiffness has the wrong sign under theta",
    ),
    Fault(
        "gradient-yield-sign", "src/rungwise/contact/analysis/sensitivity.py",
        '"R": -np.einsum(', '"R": np.einsum(', ("tests/contact/test_sensitivity.py",),
        "the gradient by compliance has the wrong sign",
    ),
    Fault(
        "tangents-of-derivative", "src/rungwise/simulation/derivatives/space_assembly.py",
        "        system.kept.along[:] = start.tangent.reshape(-1, 6)\n", "",
        ("tests/simulation/spatial/test_sensitivity.py",),
        "tangents along which contacts are deformed do not change with the start",
    ),
    Fault(
        "deformation-of-gone-contacts", "src/rungwise/simulation/derivatives/space_assembly.py",
        "        slots[: len(self._gone)][self._gone] = 0.0\n", "",
        ("tests/simulation/spatial/test_sensitivity.py",),
        "a contact that closes is deformed by derivatives of one that has gone",
    ),
    Fault(
        "slip-turns-freely", "src/rungwise/contact/analysis/active.py",
        "slip / (mu * force[0]) if mu > 0.0", "slip / force[0] if mu > 0.0",
        ("tests/contact/test_sensitivity.py",),
        "the direction of friction turns by slip over the normal force",
    ),
    Fault(
        "moment-sign", "src/rungwise/contact/analysis/closure.py",
        "moments = (arms[:, 0] * forces[:, 1] - arms[:, 1] * forces[:, 0]) / length",
        "moments = (arms[:, 0] * forces[:, 1] + arms[:, 1] * forces[:, 0]) / length",
        ("tests/contact/test_closure.py",), "moments of contact forces have the wrong sign",
    ),
    # Geometry and conditions.
    Fault(
        "margin-of-nan", "src/rungwise/scene/language/expression.py",
        "return -math.inf if math.isnan(a)", "return math.inf if math.isnan(a)",
        ("tests/scene/test_expression.py",), "a condition on what is not a number holds",
    ),
    Fault(
        "time-left-sign", "src/rungwise/scene/language/expression.py",
        "min(now - since - span, -5e-324)", "min(since - now - span, -5e-324)",
        ("tests/simulation/test_lasting.py",), "a condition that holds lacks more and more of its time",
    ),
    Fault(
        "times-of-other-segments", "src/rungwise/simulation/watched/inputs.py",
        "            clear_times(OWN, w)\n", "", ("tests/simulation/test_lasting.py",),
        "a segment counts the time for which its condition held before",
    ),
    Fault(
        "noted-in-vain", "src/rungwise/simulation/planar/state/memory.py",
        "    copy(kept.dates, state.dates)\n", "", ("tests/simulation/test_lasting.py",),
        "a step that is taken back leaves the times that it noted",
    ),
    Fault(
        "push-arc-start", "src/rungwise/world/planar/boundary.py",
        "turn = (angles[k] - angles[k - 1]) % (2.0 * math.pi)",
        "turn = (angles[k - 1] - angles[k]) % (2.0 * math.pi)", ("tests/planning/test_choices.py",),
        "rounded corners of an object go round the other way",
    ),
    # Laws of contact, one file each.
    Fault(
        "yields-the-wrong-way", "src/rungwise/scene/fields/laws/yielding.py",
        "FALL = -0.25", "FALL = 0.25", (f"{_LAWS}restitution_falls_where_the_material_yields",),
        "restitution rises where a contact yields",
    ),
    Fault(
        "pulls-beyond-its-range", "src/rungwise/scene/fields/laws/adhesion.py",
        "if pushed or gap <= contact.adhesion_range else 0.0",
        "if pushed or gap <= 2.0 * contact.adhesion_range else 0.0",
        (f"{_LAWS}leaving_takes_the_work_of_the_pull_over_its_range",), "adhesion pulls over twice its range",
    ),
    Fault(
        "static-below-kinetic", "src/rungwise/scene/fields/laws/static_friction.py",
        "contact.static_friction < contact.friction", "contact.static_friction > contact.friction",
        (f"{_LAWS}static_friction_below_kinetic_is_refused_in_a_line",),
        "static friction above the kinetic one is refused",
    ),
    # What a step leaves.
    Fault(
        "work-at-the-end", "src/rungwise/simulation/core/update_state.py",
        "lever = 0.5 * (state.v[i] + end)", "lever = end", _CORE,
        "work is that of the speeds at the end of a step", True,
    ),
    Fault(
        "fresh-keeps-deformation", "src/rungwise/simulation/core/update_state.py",
        "state.force[slot, i] = state.deformation[slot, i] = 0.0", "state.force[slot, i] = 0.0",
        ("tests/simulation/test_thresholds.py::test_contacts_of_new_features_are_deformed_by_what_bodies_overlap",),
        "a contact of new features keeps the deformation of the old ones", True,
    ),
    Fault(
        "impulse-not-added", "src/rungwise/simulation/core/update_state.py",
        "state.impulse[slot, i] += h * state.force[slot, i]",
        "state.impulse[slot, i] = h * state.force[slot, i]", _CORE,
        "impulses are those of the last step alone", True,
    ),
    Fault(
        "beyond-a-piece", "src/rungwise/system/planar/contact_manifold.py",
        "if elsewhere or not ours or",
        "if not ours or",
        ("tests/system/planar/test_seams.py",),
        "a piece touches what is level with its face, beyond its end, and beside another piece",
    ),
    Fault(
        "corner-of-the-other", "src/rungwise/system/planar/contact_manifold.py",
        "is_corner(of_b, nx, ny, outline, chains) and is_corner(of_a, -nx, -ny, outline, chains)",
        "is_corner(of_a, nx, ny, outline, chains) and is_corner(of_b, -nx, -ny, outline, chains)",
        ("tests/system/planar/test_seams.py",),
        "corners that pieces share touch nothing",
    ),
    Fault(
        "tie-by-rounding", "src/rungwise/system/planar/contact_manifold.py",
        "if of_a[0] >= of_b[0] - slack:",
        "if of_a[0] >= of_b[0]:",
        ("tests/simulation/test_outlines.py",),
        "rounding decides which of two faces keeps bodies apart where corner meets corner",
    ),
    Fault(
        "jam-unasked", "src/rungwise/simulation/planar/loop.py",
        "solve_step(trial_in(rung, h, clock.contacts, workspace)) == UNSOLVED",
        "solve_step(trial_in(rung, h, clock.contacts, workspace)) != UNSOLVED",
        ("tests/simulation/test_wedged.py::"
         "test_a_jam_is_told_where_other_short_steps_stand_between_the_refused_ones",),
        "what closed contacts leave without solution is no jam",
    ),
    # Steps without momentum.
    Fault(
        "leap-vanishes", "src/rungwise/simulation/planar/step/held.py",
        "if moved > 0.0 and not vanishes(trial):", "if moved > 0.0 and vanishes(trial):",
        ("tests/simulation/test_leaps.py::"
         "test_a_spring_that_snaps_over_a_ridge_is_told_however_little_it_moves",),
        "what vanishes with the step leaps, and what leaps does not",
    ),
    Fault(
        "leap-alone", "src/rungwise/simulation/core/held.py",
        "if is_near(trial, near, k):", "if not is_near(trial, near, k):",
        ("tests/simulation/test_leaps.py::"
         "test_what_nothing_holds_is_unsupported_however_far_it_would_go",),
        "contacts that are far hold bodies, and those that are near do not",
    ),
    # Fits.
    Fault(
        "pulled-by-itself", "src/rungwise/fitting/certainty.py",
        "np.sqrt(np.maximum(1.0 - shares, ALONE))", "np.sqrt(np.maximum(1.0 + shares, ALONE))",
        ("tests/fitting/test_certainty.py",), "slopes of trials are shortened by what each says",
    ),
    Fault(
        "trials-count-all", "src/rungwise/fitting/certainty.py",
        "np.minimum(free, len(parts) - 1.0)", "np.full_like(free, len(parts) - 1.0)",
        ("tests/fitting/test_certainty.py",), "trials that say nothing are degrees of freedom",
    ),
    Fault(
        "wider-by-fewer", "src/rungwise/fitting/certainty.py",
        "t.ppf(end, free) / norm.ppf(end)", "norm.ppf(end) / t.ppf(end, free)",
        ("tests/fitting/test_certainty.py",), "intervals are narrower where fewer trials say something",
    ),
    Fault(
        "lasts-from-the-start", "src/rungwise/fitting/measured/starts.py",
        "known[:, :middle].any(axis=1) & known[:, middle + 1 :].any(axis=1)",
        "known[:, :middle].any(axis=1) | known[:, middle + 1 :].any(axis=1)",
        ("tests/fitting/test_starts.py",), "a contact lasts where frames follow that none is before",
    ),
    Fault(
        "moved-by-deviation", "src/rungwise/fitting/measured/starts.py",
        "scaled = slope * self._scale**2", "scaled = slope * self._scale", ("tests/fitting/test_starts.py",),
        "starts are moved along what was measured as along what was not",
    ),
    Fault(
        "closed-from-below-alone", "src/rungwise/fitting/measured/starts.py",
        "(lasting & (gaps > 2.0 * clear))", "(~lasting & (gaps > 2.0 * clear))",
        ("tests/fitting/test_starts.py",), "gaps are closed where contacts do not last",
    ),
    # Units.
    Fault(
        "ratio-of-units", "src/rungwise/scene/dimensions/expressions.py",
        "1.0 if isinstance(op, ast.Mult) else -1.0", "1.0 if isinstance(op, ast.Mult) else 1.0", _UNITS,
        "the unit of a ratio is that of the product",
    ),
    Fault(
        "root-of-units", "src/rungwise/scene/dimensions/expressions.py",
        "under.power(0.5)", "under.power(2.0)", _UNITS, "the unit of a root is that of the square",
    ),
    Fault(
        "sine-of-lengths", "src/rungwise/scene/dimensions/expressions.py",
        "if found not in (None, NONE):", "if found is None:", _UNITS,
        "sines of lengths are taken, and such of anything refused",
    ),
    Fault(
        "degrees-are-ratios", "src/rungwise/scene/dimensions/check.py",
        "if own is None or (own == place.kind.powers and not is_angle):",
        "if own is None or own == place.kind.powers:", _UNITS, "angles are taken where ratios belong",
    ),
    # Hands.
    Fault(
        "friction-helps", "src/rungwise/planning/modes/hands/press.py",
        "edges = np.array([[1.0, *(-friction * slides)]])", "edges = np.array([[1.0, *(friction * slides)]])",
        _HANDS, "friction of what an object slides over is along its motion",
    ),
    Fault(
        "rises-onto", "src/rungwise/planning/modes/hands/press.py",
        "if way[0] <= least:", "if way[0] >= least:", _HANDS,
        "what an object rises from supports it, and what it is pressed on does not",
    ),
    Fault(
        "loads-carried-twice", "src/rungwise/planning/modes/hands/press.py",
        "finger.chain.joints(q) - np.clip(loads, -most, most)",
        "finger.chain.joints(q) + np.clip(loads, -most, most)", _HANDS,
        "targets of servos yield to the force with which a finger is to press",
    ),
    Fault(
        "presses-with-the-most", "src/rungwise/planning/modes/hands/press.py",
        "return float(1.0 / max(float(yields.max()) / deflection, float(strength.max()), 1e-12))",
        "return float(1.0 / max(float(yields.max()) / deflection, 1e-12))", _HANDS,
        "fingers press as far as their servos yield, however weak these are",
    ),
    Fault(
        "cycles-past-the-deepest", "src/rungwise/planning/modes/hands/gaits.py",
        "and tree.depth[node] < deepest:", "and tree.depth[node] <= deepest:", _HANDS,
        "cycles go on where a plan may have no more moves",
    ),
    Fault(
        "servo-signs", "src/rungwise/scene/space/assembly/servos.py",
        "own.set_to_position(kp=stiffness, kv=damping)", "own.set_to_position(kp=damping, kv=stiffness)",
        ("tests/scene/test_parts.py",), "servos have their damping for stiffness",
    ),
    Fault(
        "servo-unlimited", "src/rungwise/scene/space/assembly/servos.py",
        "own.forcerange, own.forcelimited = (-most, most), True",
        "own.forcerange, own.forcelimited = (-most, most), False",
        ("tests/scene/test_parts.py",), "servos of a model know no greatest force",
    ),
    Fault(
        "servo-without-range", "src/rungwise/scene/space/assembly/servos.py",
        "own.inheritrange = 1.0", "own.inheritrange = 0.0",
        ("tests/scene/test_parts.py",), "targets of servos may leave the range of their joints",
    ),
    Fault(
        "mesh-level", "src/rungwise/scene/space/meshes/solid.py", "LEVEL = 0.02", "LEVEL = 0.5",
        ("tests/simulation/spatial/test_solids.py",), "meshes with deep dents count as convex",
    ),
    Fault(
        "void-as-solid", "src/rungwise/scene/space/meshes/solid.py",
        "voids[around[0]].append(k)", "voids[k] = []",
        ("tests/simulation/spatial/test_solids.py",), "a void in a mesh is no part of the solid around it",
    ),
    Fault(
        "piece-mass", "src/rungwise/scene/space/meshes/pieces.py", "piece.mass = 0.0", "piece.mass = 1.0",
        ("tests/simulation/spatial/test_meshes.py",), "pieces of a mesh have mass beside the mesh's own",
    ),
    Fault(
        "hull-stays", "src/rungwise/scene/space/meshes/pieces.py",
        "geom.contype = geom.conaffinity = 0", "geom.contype = 0",
        ("tests/simulation/spatial/test_meshes.py",), "the hull of a mesh touches beside its pieces",
    ),
)  # fmt: skip
