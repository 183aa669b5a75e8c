"""Pictures of runs.

Read `history`, `bands`, `portrait`, `friction`, `spectra`, `animation`, `page`.
"""
