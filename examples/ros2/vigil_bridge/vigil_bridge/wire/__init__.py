"""The files of Vigil's `examples` that every publisher takes with it, as links to them.

They import each other by plain names, so that they also work without this package.
"""

import pathlib
import sys

_FOLDER = str(pathlib.Path(__file__).parent)
sys.path.insert(0, _FOLDER)
try:
    import vigil_types
    from sending import SocketPublisher
finally:
    # Their names are plain: no other package is to find them here by chance.
    sys.path.remove(_FOLDER)

__all__ = ["SocketPublisher", "vigil_types"]
