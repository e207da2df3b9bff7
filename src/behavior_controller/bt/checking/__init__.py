"""What is wrong with a mission, or cannot be meant, seen without running it."""
