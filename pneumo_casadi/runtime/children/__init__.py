"""Programs that this process starts: none of them outlives it."""

from pneumo_casadi.runtime.children.running import end_group, last_line, run_child
from pneumo_casadi.runtime.children.serving import ServingChild

__all__ = ["ServingChild", "end_group", "last_line", "run_child"]
