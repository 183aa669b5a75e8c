"""Poisson impact with Coulomb friction by stepping along the normal impulse, without any closed
form.

Over a small normal impulse dp the tangential impulse is the one in [-mu dp, mu dp] that comes
closest to stopping the slip at the end of the step (implicit Coulomb law): W_tt > 0 makes it
unique, and sticking, slipping and the passage between them need no case distinction. A step over
which dp_t/dp_n changes (slip stops or reverses inside it) is halved down to round-off size, and so
is the step that would end the compression (v_n = 0).
"""

from __future__ import annotations

import math


def _stretch(w, mu, v_t, v_n, full, length, max_steps):
    """Step until the normal impulse `length` is spent, or until v_n reaches zero: (v_t, v_n, p_t,
    p_n, ended).
    """
    (w_tt, w_tn), (_, w_nn) = w
    p_t = p_n = 0.0
    smallest, ratio = 1e-14 * full, None
    dp = smallest  # the first ratio must belong to the initial mode alone
    compressing = math.isinf(length)
    for _ in range(max_steps):
        dp = min(dp, length - p_n)
        if dp <= 0.0:
            return v_t, v_n, p_t, p_n
        step_t = min(max(-(v_t + w_tn * dp) / w_tt, -mu * dp), mu * dp)
        new_n = v_n + w_tn * step_t + w_nn * dp
        ends = compressing and new_n >= 0.0
        turns = ratio is not None and abs(step_t / dp - ratio) > 1e-6 * (mu + 1.0)
        if (ends or turns) and dp > smallest:
            dp *= 0.5
            continue
        if ends:
            return v_t, v_n, p_t, p_n
        v_t, v_n = v_t + w_tt * step_t + w_tn * dp, new_n
        p_t, p_n = p_t + step_t, p_n + dp
        if turns or ratio is None:
            ratio, dp = None if turns else step_t / dp, full
    raise ArithmeticError("the impact did not end")


def integrate_impact(w, mu, restitution, v_t, v_n, steps=500, max_steps=1_000_000):
    """(v_t+, v_n+, p_t, p_n) for W = [[W_tt, W_tn], [W_tn, W_nn]], incoming slip v_t and normal
    velocity v_n <= 0.

    v_n = 0 with dv_n/dp_n < 0 is the impact without collision (docs/model.md, section 7).
    """
    w = [[float(c) for c in row] for row in w]
    v_t, v_n = float(v_t), float(v_n)
    if v_n > 0.0:
        raise ValueError("v_n must not be positive")
    full = (abs(v_n) / w[1][1] + abs(v_t) / w[0][0]) / steps
    if full == 0.0:
        return v_t, v_n, 0.0, 0.0
    v_t, v_n, p_t, compression = _stretch(w, mu, v_t, v_n, full, math.inf, max_steps)
    more = restitution * compression
    if more > 1e-20 * compression:  # else nothing of it stays, and its steps underflow
        v_t, v_n, more_t, _ = _stretch(w, mu, v_t, v_n, more / steps, more, max_steps)
        p_t += more_t
    return v_t, v_n, p_t, compression + more
