"""What is submitted and what it is marked against, read and checked; nothing here is run."""
