"""What knows nothing of touches or of ratings."""
