"""Learning platforms that launch Robomark by LTI 1.3, tell it who is in a course, and take its marks."""
