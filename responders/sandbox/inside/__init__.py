"""What runs on the student's side of the sandbox. It imports the standard library only, and is trusted by nobody."""
