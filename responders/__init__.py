"""Programs and what answers them: the bridge between a running robot and a responder, and the messages between."""
