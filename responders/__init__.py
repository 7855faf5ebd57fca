"""Robot programs and responders: the bridge between a running robot and its responder, and the message formats."""
