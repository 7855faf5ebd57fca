"""What is submitted together: taking in, looking at, publishing and grading again."""
