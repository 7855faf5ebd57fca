"""LTI 1.3: launches from learning platforms, member lists, and passback of marks."""
