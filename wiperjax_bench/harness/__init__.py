"""How a method is measured, whichever it is; knows scenes, no method.

Read `interface` (what a method offers and answers), `measure` (timing, machine, versions), `keep`
(finished parts of a long run), `alone` (a process of its own), `batching` (JAX methods over cells),
`compare` (from curves to who leads whom).
"""
