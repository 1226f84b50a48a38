"""Who is there, who is silent, and who has ended."""
