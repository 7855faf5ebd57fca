"""People: students, staff, credentials, LTI and webhooks."""
