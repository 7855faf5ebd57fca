"""What waits and what is done with it: every change of a job, whose turn it is, and the workers."""
