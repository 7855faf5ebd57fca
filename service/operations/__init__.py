"""Operations: every action of a person or program, shared by pages, API and commands.

An operation is ``verb(service, actor, request) -> result`` in the module of its subject. It owns lookup, permission,
limits, the transaction, the activity log, the webhook events and the notification of workers.
"""
