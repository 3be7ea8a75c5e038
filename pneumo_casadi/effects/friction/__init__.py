"""Effects of friction, beyond the nominal friction law.

The nominal law, eq. 4 of the paper, is `friction_force` in ``model/friction_law.py``.
"""
