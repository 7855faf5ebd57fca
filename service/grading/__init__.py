"""From a submission and an assignment to a grade: the plan, the runs, and what they are worth."""
