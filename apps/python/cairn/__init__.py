"""Global structure-from-motion: photographs to camera poses and points.

Arrays are NumPy's. Long calls release the interpreter's lock, stop at Ctrl-C, call
`progress(stage, num_done, num_total)`, and send messages to `logging.getLogger("cairn")`. The same
seed gives the same result for any number of threads (0: all).
"""
from ._cairn import *  # noqa: F403
from ._cairn import __version__  # noqa: F401
