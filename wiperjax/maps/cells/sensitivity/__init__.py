"""Derivatives of the outcomes of cells by parameters, and whether they hold.

Read `evaluate`, `tangents`, `validity`.
"""
