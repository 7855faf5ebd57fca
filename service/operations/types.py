"""Types of the database that requests and results of operations carry, for pages, API and commands to import.

Imports nothing heavy, so that a command can import it before it runs.
"""

from service.store.states import BatchState as BatchState
from service.store.states import CredentialKind as CredentialKind
from service.store.states import JobState as JobState
from service.store.states import Lane as Lane
from service.store.states import PlotState as PlotState
from service.store.states import Role as Role
from service.store.states import Standing as Standing
from service.store.states import TryoutState as TryoutState
