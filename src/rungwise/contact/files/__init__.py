"""Contact problems on disk, both ways."""
