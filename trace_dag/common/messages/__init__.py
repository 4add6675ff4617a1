"""What the program says to people: logs, progress, words and Markdown."""
