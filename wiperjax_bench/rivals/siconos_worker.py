"""The wiper in Siconos, for the Python that has Siconos. Started by `siconos_moreau`; not imported.

Distributions build Siconos for their own Python and NumPy 1, which need not be those of wiperjax.
So this file uses only the standard library, NumPy and Siconos. Each line in is a JSON request, each
line out the answer. Siconos (MoreauJeanOSI, theta = 1/2, NewtonImpactFrictionNSL, FrictionContact)
does the stepping and the contact. Coordinates are relative to the belt, so that its friction law,
which knows resting partners only, applies; smooth forces and mu are those at the start of the step.
"""

import json
import math
import sys

import numpy as np
import siconos.kernel as sk  # pyright: ignore[reportMissingImports]


def belt_velocity(b, t):
    """V(t) of the three kinds of belt."""
    if "amplitude" in b:
        return b["amplitude"] * math.sin(2 * math.pi * b["frequency"] * t + b["phase"])
    if "ramp" not in b:
        return b["speed"]
    s = b["frequency"] * t + b["phase"] / (2 * math.pi)
    half = round(2 * s)  # nearest passage through zero, rising where even
    since = (2 * s - half) / (2 * b["frequency"])
    slope = max(-1.0, min(1.0, 2 * since / b["ramp"]))
    return b["speed"] * slope * (1 if half % 2 == 0 else -1)


def force(w, x, y, vx, vy):
    """Smooth forces on the tip, for a wiper without hinge mass; None past the end of the lip."""
    s = x / w["lip_length"]
    if not abs(s) < math.sin(w["collapse_angle"]):
        return None
    c = math.sqrt(1 - s * s)
    tau, arm = s / c, w["lip_length"] * c
    theta = math.asin(s) - w["attack_angle"]
    past = max(theta - w["shoulder_angle"], 0.0) + min(theta + w["shoulder_angle"], 0.0)
    moment = w["neck_stiffness"] * theta
    moment += (w["shoulder_stiffness"] - w["neck_stiffness"]) * past
    sink = y + arm - w["lip_length"] * math.cos(w["attack_angle"])
    down = w["normal_load"] + w["support_stiffness"] * sink
    down += w["support_damping"] * (vy - tau * vx)
    moment += w["hinge_damping"] * vx / arm
    return -moment / arm + down * tau, -down - w["tip_mass"] * w["gravity"]


def friction(w, speed):
    decay = math.exp(-((speed / w["stribeck_speed"]) ** w["stribeck_shape"]))
    rest = w["mu_minimum"] + (w["mu_static"] - w["mu_minimum"]) * decay
    return rest + w["viscous_slope"] * speed


def run(w, belt, start, duration, steps, keep):
    """Return the states (x, y, x', y') after every ``keep`` steps; short where it ended early."""
    h = duration / steps
    x0, y0, vx0, vy0 = start
    speed = belt_velocity(belt, 0.0)
    tip = sk.LagrangianLinearTIDS([x0, y0], [vx0 - speed, vy0], w["tip_mass"] * np.eye(2))
    tip.setFExtPtr(np.zeros(2))
    external = tip.fExt()  # a view of Siconos's own copy
    law = sk.NewtonImpactFrictionNSL(w["restitution"], 0.0, w["mu_static"], 2)
    contact = sk.Interaction(law, sk.LagrangianLinearTIR(np.array([[0.0, 1.0], [1.0, 0.0]])))
    model = sk.NonSmoothDynamicalSystem(0.0, duration * (1 + 1e-9))
    model.insertDynamicalSystem(tip)
    model.link(contact, tip)
    problem = sk.FrictionContact(2)
    stepper = sk.TimeStepping(model, sk.TimeDiscretisation(0.0, h), sk.MoreauJeanOSI(0.5), problem)
    travel, out = 0.0, []
    for i in range(steps):
        q, v = tip.q(), tip.velocity()
        pull = force(w, q[0] + travel, q[1], v[0] + speed, v[1])
        if pull is None or not all(map(math.isfinite, pull)):
            break
        after = belt_velocity(belt, (i + 1) * h)
        external[0] = pull[0] - w["tip_mass"] * (after - speed) / h
        external[1] = pull[1]
        law.setMu(friction(w, abs(v[0])))
        if i:  # it keeps a copy, made in the first step
            problem.updateMu()
        stepper.computeOneStep()
        stepper.nextStep()
        travel += 0.5 * h * (speed + after)
        speed = after
        if (i + 1) % keep == 0:
            q, v = tip.q(), tip.velocity()
            out.append([q[0] + travel, q[1], v[0] + speed, v[1]])
    return out


def main():
    print(json.dumps({"ready": True}), flush=True)
    for line in sys.stdin:
        cells = json.loads(line)
        print(json.dumps([run(**cell) for cell in cells]), flush=True)


if __name__ == "__main__":
    main()
