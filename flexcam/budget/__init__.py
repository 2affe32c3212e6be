"""What a run takes, in memory and on disk, before it begins, and what there is of both.

May import `case`, `io`, `train` and everything below them; `runner` stands above.
Another thing that a run keeps is a new term of the estimate; `flexcam check` prints it.
"""

from flexcam.budget.needs import Budget, budget
from flexcam.budget.room import free_disk, free_memory
from flexcam.budget.within import affordable, affordable_mesh, size

__all__ = ["Budget", "affordable", "affordable_mesh", "budget", "free_disk", "free_memory", "size"]
