"""Correction of holds in which the bristle had not settled, which it does as exp(-x sigma_0 / g) over the way x."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from bristle.estimation import levels
from bristle.identification.known_joint import chosen
from bristle.identification.measured import Measured, judged
from bristle.identification.results import Joint
from bristle.model import functions
from bristle.model.parameters import SIGNED, Pair, in_direction, lugre_of
from bristle.model.rollout import rollout
from bristle.model.vectorize import evaluate

_FIRST = 100  # one over the first part of a log, which tells the initial deflection


def without_settling(measured: Measured, joint: Joint, before: Measured) -> Measured | None:
    """The same with each point corrected by a simulation of its run; None where points stay as they were `before`."""
    known, sets, curves = {row.parameter: row.estimate.value for row in chosen(joint)}, [], []
    for d in SIGNED:
        fit = joint.static.get(d) or joint.static.get("both") or next(iter(joint.static.values()), None)
        curve, stiffness = None if fit is None else fit.values(), in_direction(known, "sigma_0", d)
        if fit is None or curve is None or not stiffness:
            return None
        damping = in_direction(known, "sigma_1", d) or 0.0
        curves.append(curve)
        sets.append(lugre_of(fit.law)(**curve._asdict(), sigma_0=stiffness, sigma_1=damping))
    steady, largest, segments = functions.steady_torque_function(sets[0].law), 0.0, []
    for run, found, last in zip(measured.runs, measured.segments, before.segments, strict=True):
        record, own = run.record, list(found)
        points = [k for k, s in enumerate(found) if s.accepted]
        if run.kind == "ramp" and record.velocity is not None and record.torque is not None and points:
            velocity, torque = np.array(record.velocity), np.empty(record.time.size)
            begins = {k: found[k].start for k in points}
            for k in points:
                # constant from where the position is straight on, because noise changes the sign of slow velocities
                s = found[k]
                if record.position is not None:
                    line = record.position - s.velocity * record.time
                    line -= line[s.start : s.stop].mean()
                    bent = np.flatnonzero(
                        np.abs(line[: s.start]) > levels.STRAIGHT * np.abs(line[s.start : s.stop]).max()
                    )
                    begins[k] = max(int(bent[-1]) + 1 if bent.size else 0, *(x for x in record.starts if x <= s.start))
                velocity[begins[k] : s.stop] = s.velocity
            for start, stop in pairwise([*record.starts, velocity.size]):
                T0 = record.torque[start : start + max((stop - start) // _FIRST, 1)].mean()
                p = sets[int(T0 < 0)]
                z0 = float(np.clip(T0, -p.alpha_0 - p.alpha_1, p.alpha_0 + p.alpha_1)) / p.sigma_0
                steps = np.diff(record.time[start:stop])
                torque[start:stop] = rollout(velocity[start:stop], steps, Pair(*sets), z0).torque
            error = float(np.median([found[k].standard_error or np.inf for k in points]))  # they count alike in the fit
            turns, squares, off = np.flatnonzero(np.diff(np.sign(velocity))) + 1, np.zeros(2), dict[int, float]()
            for k in points:
                s = found[k]
                (settled,) = evaluate(steady, s.velocity, *curves[s.velocity < 0])
                off[k] = float(torque[s.start : s.stop].mean() - settled)
                # approach of the torque to its mean since the last reversal, at the hold's speed
                begun = slice(max(turns[turns <= begins[k]], default=0), s.stop)
                near = np.abs(velocity[begun] - s.velocity) < levels.ON_THE_WAY * abs(s.velocity)
                left = record.torque[begun][near] - np.stack([torque[begun][near], np.full(near.sum(), settled)])
                squares += ((left - left[:, s.start - s.stop :].mean(axis=1, keepdims=True)) ** 2).sum(axis=1)
            if squares[0] < squares[1]:
                for k in points:
                    own[k] = replace(found[k], torque=found[k].torque - off[k])
            largest = max(largest, *(abs(own[k].torque - last[k].torque) / error for k in points))
        segments.append(tuple(own))
    return judged(replace(measured, segments=tuple(segments))) if largest > levels.CORRECTED else None
