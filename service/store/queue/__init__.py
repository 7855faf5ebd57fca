"""The job queue: transitions of jobs, scheduling and workers."""
