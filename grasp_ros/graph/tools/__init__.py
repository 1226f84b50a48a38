"""What a user watches, steers and plays with."""
