"""Messages to people: logs, progress, wording and Markdown."""
