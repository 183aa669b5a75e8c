"""Cells on lanes: parameters in, columns of a map out.

Read `batch`, `evaluate`, `columns`, `devices`, `sensitivity`.
"""
