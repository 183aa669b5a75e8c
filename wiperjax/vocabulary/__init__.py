"""Every name, unit, code and border, stated once; imports nothing of wiperjax.

Read `parameters` (blade and belt: names, units, reference values, ranges), `kinds` (belts,
friction laws, models, solvers), `codes` (regimes, events, results, classes), `thresholds` (borders
of the classes), `schema` (variables of a map), `products` (kinds of files), `pictures` (files of
these), `cf` (how codes and units are written into a file), `ranges`, `checks` and `wording` (what a
person may give, and how it is refused).
"""
