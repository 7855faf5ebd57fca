"""Every action that a person or a program can take, once: pages, API and commands call these functions.

An operation is ``verb(service, actor, request) -> result`` in the module of its subject. It owns lookup, permission,
limits, the transaction, the activity log, the outbox and the notification of workers.
"""
