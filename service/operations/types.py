"""Store types in the requests and results of operations, for pages, API and commands to import.

Has no slow imports, so that commands can import it at start-up.
"""

from service.store.states import BatchState as BatchState
from service.store.states import ChangeStage as ChangeStage
from service.store.states import CompletionRule as CompletionRule
from service.store.states import CountedAttempt as CountedAttempt
from service.store.states import CredentialKind as CredentialKind
from service.store.states import JobQueue as JobQueue
from service.store.states import JobState as JobState
from service.store.states import PlotState as PlotState
from service.store.states import ReleaseRule as ReleaseRule
from service.store.states import Role as Role
from service.store.states import RunState as RunState
from service.store.states import Standing as Standing
