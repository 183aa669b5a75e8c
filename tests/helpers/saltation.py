"""Saltation matrices.

A perturbation of the state that passes an event at which the motion changes from f- to f+ after a
reset R, with the event function g, is multiplied by the saltation matrix

    S = DR + (f+ - DR f-) g_x / (g_t + g_x f-)        x = (q, v)

Leine and Nijmeijer, "Dynamics and Bifurcations of Non-Smooth Mechanical Systems" (2004), ch. 7;
di Bernardo, Budd, Champneys and Kowalczyk, "Piecewise-smooth Dynamical Systems" (2008), ch. 2.
"""

import numpy as np


def saltation(reset, gradient, before, after, rate_t=0.0):
    """S from DR, dg/dx, f- and f+; ``rate_t`` is dg/dt."""
    reset, gradient = np.asarray(reset, float), np.asarray(gradient, float)
    before, after = np.asarray(before, float), np.asarray(after, float)
    return reset + np.outer(after - reset @ before, gradient) / (rate_t + gradient @ before)
