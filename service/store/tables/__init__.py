"""The tables, one module for each subject.

They contain only columns and constraints. The modules beside this package contain the operations. A class has the name
of its table. The suffix ``...Row`` is added if a class with that name exists (``Submission``, ``Trial``).
"""

from __future__ import annotations

from service.store.tables import courses, grades, installation, people, statements, submissions
from service.store.tables.base import Base

__all__ = ["METADATA", "courses", "grades", "installation", "people", "statements", "submissions"]

#: All tables. The modules above are imported so that it is complete.
METADATA = Base.metadata
