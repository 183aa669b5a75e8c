"""How numba compiles the loop.

numba's cache asks only whether the file of the function itself has changed. So a function is cached
only where everything it calls stands in its own file; the outermost ones carry a digest of all.
"""

from numba import njit

# arithmetic may be reassociated and contracted; NaN and infinity stay what they are
FAST = {"contract", "reassoc", "nsz", "arcp", "afn"}

cached = njit(fastmath=FAST, error_model="numpy", cache=True)  # calls its own file only
inner = njit(fastmath=FAST, error_model="numpy")
# a part of a longer one, compiled into its caller: calls that hand over records cost a fifth
part = njit(fastmath=FAST, error_model="numpy", forceinline=True)
